#include "replay/truth.hpp"

#include <algorithm>

namespace frontier_surfels::replay {

using scoring::ObjectScore;
using scoring::ObjectTest;

Truth::Truth(const Config& config, std::shared_ptr<TruthFolder> folder)
    : folder_(std::move(folder)), exact_(config), objects_(config, folder_->objects()) {}

void Truth::add(std::size_t index, const DepthFrame& recorded, const ObjectTest::SurfelsIn& surfels_in) {
  const RecordedFrame ideal = folder_->frame_for(index, recorded);
  exact_.add(ideal.view());
  objects_.add(index, ideal.view(), surfels_in);
  frames_.push_back(index);
  if (!folder_->objects().empty()) tell_what_stands_now();
}

/// Any frame may be the last one.
void Truth::tell_what_stands_now() {
  std::vector<scoring::PlacedBox> placed;
  for (const scoring::SceneObject& object : folder_->objects()) {
    const scoring::Stand* stand = object.stand_at(frames_.back());
    if (stand == nullptr) continue;
    const auto before = static_cast<std::size_t>(std::lower_bound(frames_.begin(), frames_.end(), stand->first) - frames_.begin());
    for (const scoring::OrientedBox& box : object.placed(*stand)) placed.push_back({box, before});
  }
  exact_.set_placed(placed);
}

std::vector<ObjectScore> Truth::objects(const std::vector<Surfel>& surfels) const {
  return objects_.score([&](const Eigen::AlignedBox3d& box) {
    std::vector<Surfel> inside;
    std::copy_if(surfels.begin(), surfels.end(), std::back_inserter(inside),
                 [&](const Surfel& surfel) { return box.contains(surfel.position.cast<double>()); });
    return inside;
  });
}

}  // namespace frontier_surfels::replay
