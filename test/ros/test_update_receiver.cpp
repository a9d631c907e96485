/// UpdateReceiver with random histories of a map: whatever updates are lost, repeated, reordered or merged, the copy always equals a map
/// that the mapper had.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "ros/client/map_subscriber.hpp"
#include "ros/output/surfel_messages.hpp"

namespace frontier_surfels {
namespace {

using Random = std::mt19937;

int draw(Random& random, int most) { return std::uniform_int_distribution<int>(0, most)(random); }

bool same(const Surfel& a, const Surfel& b) {
  return a.id == b.id && a.position == b.position && a.normal == b.normal && a.radius == b.radius && a.label == b.label && a.rgb == b.rgb;
}

bool same(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Surfel& x, const Surfel& y) { return same(x, y); });
}

/// A map whose surfels come, change and go. Ids are used again.
class Truth {
 public:
  explicit Truth(unsigned seed) : random_(seed) { history_.emplace_back(); }

  void step() {
    ++sequence_;
    for (int i = draw(random_, 20); i > 0; --i) {
      const auto id = static_cast<std::uint32_t>(draw(random_, 60));
      Slot& slot = slots_[id];
      // An id may be used again only after its removal could be sent.
      if (!slot.surfel && slot.changed == sequence_) continue;
      slot.changed = sequence_;
      slot.surfel.reset();
      if (draw(random_, 2) > 0) slot.surfel = surfel(id);
    }
    history_.push_back(changes(0).updated);
  }

  Changes changes(std::uint64_t since) const {
    Changes changes;
    changes.sequence = sequence_;
    for (const auto& [id, slot] : slots_) {
      if (slot.changed <= since) continue;
      if (slot.surfel) {
        changes.updated.push_back(*slot.surfel);
      } else {
        changes.removed.push_back(id);
      }
    }
    return changes;
  }

  SurfelUpdate update(std::uint64_t since) const {
    const Changes contained = changes(since);
    SurfelUpdate message;
    message.sequence = contained.sequence;
    message.since = since;
    message.surfels = messages::to_cloud(contained.updated);
    message.removed = contained.removed;
    return message;
  }

  /// The same update in parts of at most ten surfels.
  std::vector<SurfelUpdate> parts(std::uint64_t since) const {
    const Changes contained = changes(since);
    messages::UpdateMessages messages(contained, since, Eigen::AlignedBox3f(), Label::kFrontier, 10);
    std::vector<SurfelUpdate> parts;
    while (!messages.done()) parts.push_back(messages.next());
    return parts;
  }

  std::uint64_t sequence() const { return sequence_; }

  /// All surfels when the map had this number, ordered by id.
  const std::vector<Surfel>& at(std::uint64_t sequence) const { return history_.at(sequence); }

 private:
  struct Slot {
    std::optional<Surfel> surfel;
    std::uint64_t changed = 0;
  };

  Surfel surfel(std::uint32_t id) {
    std::uniform_real_distribution<float> number(-3, 3);
    Surfel surfel;
    surfel.position = {number(random_), number(random_), number(random_)};
    surfel.normal = Eigen::Vector3f(number(random_), number(random_), 4).normalized();
    surfel.radius = 0.01f + std::abs(number(random_));
    surfel.label = draw(random_, 1) == 0 ? Label::kFrontier : Label::kOccupied;
    for (std::uint8_t& channel : surfel.rgb) channel = static_cast<std::uint8_t>(draw(random_, 255));
    surfel.id = id;
    return surfel;
  }

  Random random_;
  std::uint64_t sequence_ = 0;
  std::map<std::uint32_t, Slot> slots_;
  std::vector<std::vector<Surfel>> history_;
};

/// A receiver of a Truth's updates. Its service can give old answers or fail.
class UpdateReceiverTest : public testing::Test {
 protected:
  void step(int count = 1) {
    for (int i = 0; i < count; ++i) truth_.step();
  }
  void receive(std::uint64_t since) { receiver_.receive(truth_.update(since)); }
  bool has(std::uint64_t sequence) const {
    return receiver_.map().sequence() == sequence && same(receiver_.map().surfels(), truth_.at(sequence));
  }

  Truth truth_{7};
  int asked_ = 0;
  bool out_of_order_ = false;
  std::optional<Changes> answer_;  ///< what the service answers, if it is not the present map
  UpdateReceiver receiver_{[this] {
    ++asked_;
    if (out_of_order_) throw Error("The service does not answer.");
    return answer_ ? *answer_ : truth_.changes(0);
  }};
};

TEST_F(UpdateReceiverTest, FollowsFromTheStart) {
  for (std::uint64_t since = 0; since < 20; ++since) {
    step();
    receive(since);
    ASSERT_TRUE(has(since + 1)) << "at number " << since + 1;
  }
  EXPECT_EQ(asked_, 0);
  EXPECT_EQ(receiver_.gaps(), 0u);
}

TEST_F(UpdateReceiverTest, WhoJoinsLateAsksOnce) {
  step(10);
  receive(9);
  EXPECT_TRUE(has(10));
  step();
  receive(10);
  EXPECT_TRUE(has(11));
  EXPECT_EQ(asked_, 1);
  EXPECT_EQ(receiver_.gaps(), 0u) << "no update was missing";
}

TEST_F(UpdateReceiverTest, AppliesAnUpdateWhenAllItsPartsHaveCome) {
  step(5);
  for (const SurfelUpdate& part : truth_.parts(0)) {
    EXPECT_EQ(receiver_.map().sequence(), 0u) << "before part " << part.part;
    receiver_.receive(part);
  }
  EXPECT_TRUE(has(5));
  step(5);
  const auto parts = truth_.parts(5);
  ASSERT_GT(parts.size(), 2u);
  for (const SurfelUpdate& part : parts) {
    EXPECT_TRUE(has(5)) << "before part " << part.part;
    receiver_.receive(part);
  }
  EXPECT_TRUE(has(10));
  EXPECT_EQ(asked_, 0);
}

TEST_F(UpdateReceiverTest, HealsTheLossOfAPart) {
  step();
  receive(0);
  for (const std::size_t lost : {0, 1, 2}) {
    const std::uint64_t before = truth_.sequence();
    step(5);
    auto parts = truth_.parts(before);
    ASSERT_GT(parts.size(), 2u);
    parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(std::min(lost, parts.size() - 1)));
    for (const SurfelUpdate& part : parts) receiver_.receive(part);
    EXPECT_TRUE(has(before)) << "an incomplete update was applied";
    step();
    receive(before + 5);
    EXPECT_TRUE(has(before + 6));
  }
  EXPECT_EQ(asked_, 3);
  EXPECT_EQ(receiver_.gaps(), 3u);
}

TEST_F(UpdateReceiverTest, HealsAGap) {
  step();
  receive(0);
  step(2);
  receive(2);
  EXPECT_TRUE(has(3));
  EXPECT_EQ(asked_, 1);
  EXPECT_EQ(receiver_.gaps(), 1u);
}

TEST_F(UpdateReceiverTest, GoesOnAfterAGapWithUpdatesThatTheWholeMapContained) {
  step();
  receive(0);
  step(2);
  const SurfelUpdate third = truth_.update(2);
  step();
  const SurfelUpdate fourth = truth_.update(3);
  step();
  receiver_.receive(third);  // the service answers with map 5
  EXPECT_TRUE(has(5));
  receiver_.receive(fourth);
  EXPECT_TRUE(has(5));
  step();
  receive(5);
  EXPECT_TRUE(has(6));
  EXPECT_EQ(asked_, 1);
}

TEST_F(UpdateReceiverTest, TakesTheUpdateAsWellWhereTheServiceAnswersWithTheMapBeforeIt) {
  step();
  receive(0);
  step(2);
  answer_ = truth_.changes(0);
  step();
  receive(2);  // with the changes to maps 3 and 4; the service answers with map 3
  EXPECT_TRUE(has(4));

  step();
  const SurfelUpdate missed = truth_.update(4);
  step();
  receive(5);  // with the changes to map 6; the service still answers with map 3
  EXPECT_TRUE(has(3)) << "an update was applied to a map that it does not continue";
  answer_.reset();
  receive(5);
  EXPECT_TRUE(has(6));
  receiver_.receive(missed);
  EXPECT_TRUE(has(6));
}

TEST_F(UpdateReceiverTest, IgnoresWhatItKnowsAndTakesWhatOverlaps) {
  step();
  receive(0);
  step();
  const SurfelUpdate second = truth_.update(1);
  receiver_.receive(second);
  receiver_.receive(second);
  EXPECT_TRUE(has(2));
  step(3);
  receive(1);  // with the changes to maps 2 to 5, of which map 2 is known
  EXPECT_TRUE(has(5));
  receiver_.receive(second);
  EXPECT_TRUE(has(5));
  EXPECT_EQ(asked_, 0);
}

TEST_F(UpdateReceiverTest, TakesTheWholeMapOfAMapperThatWasStartedAgain) {
  step(30);
  receive(0);
  Truth other(8);
  other.step();
  receiver_.receive(other.update(0));
  EXPECT_EQ(receiver_.map().sequence(), 1u);
  EXPECT_TRUE(same(receiver_.map().surfels(), other.at(1)));
}

TEST_F(UpdateReceiverTest, AsksAgainAfterAServiceThatFailed) {
  step();
  receive(0);
  out_of_order_ = true;
  step(2);
  EXPECT_THROW(receive(2), Error);
  EXPECT_TRUE(has(1)) << "the copy changed although the service failed";
  step();
  EXPECT_THROW(receive(3), Error);
  out_of_order_ = false;
  step();
  receive(4);
  EXPECT_TRUE(has(5));
  EXPECT_EQ(asked_, 3);
  EXPECT_EQ(receiver_.gaps(), 1u) << "it is one gap, however often the service was asked";
}

TEST_F(UpdateReceiverTest, RefusesWhatItCannotRead) {
  step(5);
  receive(0);
  step(5);
  SurfelUpdate damaged = truth_.update(5);
  ASSERT_GT(damaged.surfels.data.size(), 0u);
  damaged.surfels.data.pop_back();
  EXPECT_THROW(receiver_.receive(damaged), Error);
  EXPECT_TRUE(has(5));
  receive(5);
  EXPECT_TRUE(has(10));
}

/// What may happen to an update on its way.
enum class Fate { kArrives, kIsLost, kArrivesTwice, kComesLate, kIsMergedWithNext, kIsWhole };

TEST_F(UpdateReceiverTest, EveryStateIsOneThatTheMapHasHad) {
  int gaps = 0, failures = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Random random(seed);
    Truth truth(1000 + seed);
    int chance_of_failure = draw(random, 2);  // of the service; 0: never
    UpdateReceiver receiver([&] {
      if (chance_of_failure > 0 && draw(random, 3) < chance_of_failure) throw Error("The service does not answer.");
      return truth.changes(0);
    });
    const auto receive = [&](const SurfelUpdate& update) {
      try {
        receiver.receive(update);
      } catch (const Error&) {
        ++failures;
      }
      ASSERT_TRUE(same(receiver.map().surfels(), truth.at(receiver.map().sequence())))
          << "seed " << seed << ", number " << receiver.map().sequence();
    };

    std::vector<SurfelUpdate> late;
    std::uint64_t published = 0;
    for (int join = draw(random, 10), i = 0; i < 60; ++i) {
      truth.step();
      const auto fate = static_cast<Fate>(draw(random, 5));
      if (fate == Fate::kIsMergedWithNext) continue;
      const SurfelUpdate update = truth.update(fate == Fate::kIsWhole ? 0 : published);
      published = truth.sequence();
      if (i < join || fate == Fate::kIsLost) continue;
      if (fate != Fate::kComesLate) receive(update);
      if (fate == Fate::kArrivesTwice || fate == Fate::kComesLate) late.push_back(update);
      if (!late.empty() && draw(random, 2) == 0) {
        const std::size_t chosen = static_cast<std::size_t>(draw(random, static_cast<int>(late.size()) - 1));
        receive(late[chosen]);
        late.erase(late.begin() + static_cast<std::ptrdiff_t>(chosen));
      }
    }
    chance_of_failure = 0;
    truth.step();
    receive(truth.update(published));
    ASSERT_EQ(receiver.map().sequence(), truth.sequence()) << "seed " << seed << ": the copy is behind at the end";
    gaps += static_cast<int>(receiver.gaps());
  }
  EXPECT_GT(gaps, 200) << "the histories have too few gaps to be a test";
  EXPECT_GT(failures, 50);
}

}  // namespace
}  // namespace frontier_surfels
