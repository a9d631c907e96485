#include "frame/limits.hpp"

#include <cmath>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

Limits make_limits(const Config& config) {
  Limits limits = {};
  limits.th_d = static_cast<float>(config.th_d);
  limits.peak = static_cast<float>(std::round(config.peak * SIGN_FIELD_ONE));
  limits.thickness = static_cast<float>(config.thickness);
  limits.hull_unknown_scale = 1.5F;
  limits.split_radius = 2 * std::sqrt(3.0F);
  limits.create_radius = static_cast<float>(kNewRadius);
  limits.normal_min = 0.01F;
  limits.back_probe = static_cast<float>(kBackProbe);
  limits.front_probe = static_cast<float>(kFrontProbe) * limits.create_radius;
  limits.min_gap = static_cast<float>(config.min_gap);
  limits.surface_depth = static_cast<float>(config.surface_depth);
  limits.median_votes = config.median_votes;
  limits.remove_buried = config.remove_buried ? 1 : 0;
  limits.refine = config.refine_surfels ? 1 : 0;
  return limits;
}

}  // namespace frontier_surfels
