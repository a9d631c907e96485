#include "frontier_surfels/scoring/object_test.hpp"

#include <algorithm>

#include "scoring/decimated_depth.hpp"
#include "scoring/object_faces.hpp"
#include "scoring/object_left.hpp"

namespace frontier_surfels::scoring {

namespace {

struct ObjectRecord {
  explicit ObjectRecord(const SceneObject& object) : left(object) {
    for (const Stand& stand : object.stands)
      if (stand.last - stand.first >= ObjectTest::kEarlyFrames) stands.emplace_back(object, stand);
  }

  std::vector<StandRecord> stands;
  LeftPlaces left;
  std::optional<LeftSurfels> most_left;
};

LeftSurfels more(const std::optional<LeftSurfels>& a, const LeftSurfels& b) {
  return a ? LeftSurfels{std::max(a->occupied, b.occupied), std::max(a->frontier, b.frontier)} : b;
}

}  // namespace

struct ObjectTest::Impl {
  DepthReading reading;
  std::vector<SceneObject> objects;
  std::vector<ObjectRecord> records;  ///< of each object
  std::vector<LaterView> later;       ///< the frames since an object has left a place
  std::size_t last_frame = 0;
};

ObjectTest::ObjectTest(const Config& config, std::vector<SceneObject> objects)
    : impl_(new Impl{DepthReading(config), std::move(objects), {}, {}, 0}) {
  for (const SceneObject& object : impl_->objects) impl_->records.emplace_back(object);
}

ObjectTest::~ObjectTest() = default;
ObjectTest::ObjectTest(ObjectTest&&) noexcept = default;
ObjectTest& ObjectTest::operator=(ObjectTest&&) noexcept = default;

const std::vector<SceneObject>& ObjectTest::objects() const { return impl_->objects; }

void ObjectTest::add(std::size_t index, const DepthFrame& ideal, const SurfelsIn& surfels_in) {
  check_frame(ideal);
  impl_->last_frame = index;
  const auto has_left = [&](const ObjectRecord& record) { return record.left.any_before(index); };
  if (std::any_of(impl_->records.begin(), impl_->records.end(), has_left))
    impl_->later.push_back({index, ExactView(ideal, impl_->reading)});
  for (ObjectRecord& record : impl_->records) {
    for (StandRecord& stand : record.stands)
      if (stand.stand().includes(index)) stand.add(index, ideal, impl_->reading, surfels_in);
    if (surfels_in && has_left(record)) record.most_left = more(record.most_left, record.left.count(index, impl_->later, surfels_in));
  }
}

std::vector<ObjectScore> ObjectTest::score(const SurfelsIn& surfels_in) const {
  std::vector<ObjectScore> scores;
  for (std::size_t i = 0; i < impl_->objects.size(); ++i) {
    const ObjectRecord& record = impl_->records[i];
    ObjectScore score;
    score.name = impl_->objects[i].name;
    for (const StandRecord& stand : record.stands)
      score.stands.push_back(stand.score(stand.stand().includes(impl_->last_frame) ? surfels_in : SurfelsIn()));
    if (record.left.any_before(impl_->last_frame)) score.left = record.left.count(impl_->last_frame, impl_->later, surfels_in);
    score.most_left = record.most_left;
    scores.push_back(std::move(score));
  }
  return scores;
}

}  // namespace frontier_surfels::scoring
