// The log of changed slots against a list of everything that frames have changed.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "map/change_log.hpp"

namespace frontier_surfels {
namespace {

using Word = ChangeLog::Word;
using Words = ChangeLog::Words;

/// Notes what a log is told, and answers slowly.
class SlowLog {
 public:
  void note(std::uint32_t frame, const std::vector<std::uint32_t>& pages, const Words& words) {
    for (std::size_t n = 0; n < pages.size(); ++n) changed_[frame][pages[n]] |= words[n];
  }
  std::map<std::size_t, Word> since(std::uint64_t since) const {
    std::map<std::size_t, Word> all;
    for (const auto& [frame, pages] : changed_)
      if (frame > since)
        for (const auto& [page, word] : pages)
          if (word != 0) all[page] |= word;
    return all;
  }

 private:
  std::map<std::uint32_t, std::map<std::size_t, Word>> changed_;
};

std::map<std::size_t, Word> by_page(const Words& words) {
  std::map<std::size_t, Word> all;
  for (std::size_t page = 0; page < words.size(); ++page)
    if (words[page] != 0) all[page] = words[page];
  return all;
}

bool contains(const std::map<std::size_t, Word>& all, const std::map<std::size_t, Word>& some) {
  return std::all_of(some.begin(), some.end(), [&](const auto& entry) {
    const auto found = all.find(entry.first);
    return found != all.end() && (found->second & entry.second) == entry.second;
  });
}

/// A map with readers that ask at times of their own.
class Simulation {
 public:
  explicit Simulation(std::size_t readers, unsigned seed) : readers_(readers, 0), known_(readers), random_(seed) {}

  /// A frame changes some slots, in one note or several.
  void frame() {
    ++now_;
    for (unsigned notes = 1 + random_() % 2; notes > 0; --notes) {
      std::vector<std::uint32_t> pages;
      Words words;
      for (std::uint32_t page = 0; page < 6; ++page)
        if (random_() % 3 == 0) {
          pages.push_back(page);
          words.push_back(random_() % 4 == 0 ? 0 : Word{1} << random_() % 64);
          if (words.back() != 0) alive_[page] = (Word{random_()} << 32 | random_()) & (Word{random_()} << 32 | random_());
        }
      log.note(static_cast<std::uint32_t>(now_), pages, words);
      slow_.note(static_cast<std::uint32_t>(now_), pages, words);
    }
  }

  void ask(std::size_t reader) {
    const ChangeLog::Difference difference = log.since(readers_[reader]);
    if (readers_[reader] != 0) {
      const auto told = by_page(difference.changed), expected = slow_.since(readers_[reader]);
      EXPECT_TRUE(contains(told, expected)) << "a change since " << readers_[reader] << " is missing at " << now_;
      exact += told == expected;
      ++asked;
      // Of what has changed, the reader must be told of the end of what it knows.
      std::map<std::size_t, Word> ends;
      for (const auto& [page, word] : expected)
        if ((word & known_[reader][page]) != 0) ends[page] = word & known_[reader][page];
      EXPECT_TRUE(contains(by_page(difference.known), ends));
    }
    readers_[reader] = now_;
    known_[reader] = alive_;
    std::set<std::uint64_t> maps(readers_.begin(), readers_.end());
    maps.erase(0);
    check_alive();
    log.divide({maps.begin(), maps.end()}, now_, alive_);
    const auto known = by_page(log.known(alive_.size()));
    for (std::size_t n = 0; n < readers_.size(); ++n) {
      EXPECT_TRUE(contains(known, by_page(known_[n]))) << "what reader " << n << " knows is not reserved";
    }
    if (maps.size() == 1) {
      EXPECT_EQ(known, by_page(alive_)) << "all readers have this map";
    }
  }

  void run(int frames) {
    for (std::size_t reader = 0; reader < readers_.size(); ++reader) ask_first(reader);
    for (int n = 0; n < frames; ++n) {
      frame();
      for (std::size_t reader = 0; reader < readers_.size(); ++reader)
        if (random_() % (reader + 2) == 0) ask(reader);
    }
  }

  ChangeLog log;
  int asked = 0, exact = 0;

 private:
  /// What was alive before and the pages that have changed since are enough to know what is alive.
  void check_alive() const {
    std::optional<Words> alive = log.alive_before();
    if (!alive) return;
    alive->resize(alive_.size(), 0);
    for (const std::uint32_t page : log.changed_pages(alive_.size())) (*alive)[page] = alive_[page];
    EXPECT_EQ(*alive, alive_);
  }

  void ask_first(std::size_t reader) {
    frame();
    ask(reader);
  }

  std::vector<std::uint64_t> readers_;  ///< the map that each has
  std::vector<Words> known_;            ///< the slots of that map
  std::mt19937 random_;
  SlowLog slow_;
  Words alive_ = Words(6, 0);
  std::uint64_t now_ = 0;
};

TEST(ChangeLog, IsExactForItsReaders) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    Simulation simulation(1 + seed % 5, seed);
    simulation.run(60);
    EXPECT_GT(simulation.asked, 10);
    EXPECT_EQ(simulation.exact, simulation.asked);
  }
}

TEST(ChangeLog, ForgetsNothingForManyReaders) {
  Simulation simulation(20, 1);
  simulation.run(200);
  EXPECT_GT(simulation.asked, 300);
  EXPECT_LT(simulation.exact, simulation.asked) << "there are too few sets for this, so that the test asks too little";
}

TEST(ChangeLog, TheLastFrameIsExactForEverybody) {
  Simulation simulation(3, 2);
  simulation.run(10);
  simulation.log.note(100, {2, 4}, {1, 6});
  simulation.log.note(101, {1}, {8});
  simulation.log.note(101, {3}, {2});
  EXPECT_EQ(by_page(simulation.log.since(100).changed), (std::map<std::size_t, Word>{{1, 8}, {3, 2}}));
}

TEST(ChangeLog, MayHaveChangedAltogether) {
  ChangeLog log;
  log.note(1, {0}, {1});
  log.divide({1}, 1, {1});
  log.note_all(2, 3);
  EXPECT_EQ(log.since(1).changed, Words(3, ~Word{0}));
  log.clear();
  EXPECT_TRUE(by_page(log.since(1).changed).empty());
}

}  // namespace
}  // namespace frontier_surfels
