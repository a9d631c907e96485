#include "scoring/object_left.hpp"

#include <algorithm>

namespace frontier_surfels::scoring {

namespace {

using ViewIterator = std::vector<LaterView>::const_iterator;

/// Whether one of the views sees the point.
bool is_seen(const Eigen::Vector3d& p_world, ViewIterator first, ViewIterator last) {
  return std::any_of(first, last, [&](const LaterView& later) { return later.view.sees(p_world); });
}

/// Whether these views see the point, and all around it.
bool is_in_the_open(const Eigen::Vector3d& p_world, ViewIterator first, ViewIterator last) {
  if (!is_seen(p_world, first, last)) return false;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      if (!is_seen(p_world + side * ObjectTest::kLeftDistance * Eigen::Vector3d::Unit(axis), first, last)) return false;
    }
  }
  return true;
}

}  // namespace

LeftPlaces::LeftPlaces(const SceneObject& object) {
  for (const Stand& stand : object.stands) {
    Place place{stand.first, stand.last, object.placed(stand), {}};
    for (OrientedBox& box : place.boxes) {
      box.half_size.array() += ObjectTest::kLeftDistance;
      place.bounds.extend(box.bounds());
    }
    places_.push_back(place);
  }
}

const LeftPlaces::Place* LeftPlaces::left_place(const Eigen::Vector3d& p_world, std::size_t frame) const {
  for (auto place = places_.rbegin(); place != places_.rend(); ++place) {
    if (place->first > frame || !place->bounds.contains(p_world)) continue;
    const auto contains = [&](const OrientedBox& box) { return box.contains(p_world); };
    if (std::none_of(place->boxes.begin(), place->boxes.end(), contains)) continue;
    return place->last < frame ? &*place : nullptr;
  }
  return nullptr;
}

LeftSurfels LeftPlaces::count(std::size_t frame, const std::vector<LaterView>& views, const ObjectTest::SurfelsIn& surfels_in) const {
  LeftSurfels left;
  if (views.size() <= ObjectTest::kSettleFrames) return left;
  const auto settled = views.end() - ObjectTest::kSettleFrames;
  Eigen::AlignedBox3d bounds;
  for (const Place& place : places_)
    if (place.last < frame) bounds.extend(place.bounds);
  for (const Surfel& surfel : surfels_in(bounds)) {
    const Eigen::Vector3d p_world = surfel.position.cast<double>();
    const Place* place = left_place(p_world, frame);
    if (place == nullptr) continue;
    const auto since = std::find_if(views.begin(), settled, [&](const LaterView& later) { return later.index > place->last; });
    if (is_in_the_open(p_world, since, settled)) ++(surfel.label == Label::kOccupied ? left.occupied : left.frontier);
  }
  return left;
}

}  // namespace frontier_surfels::scoring
