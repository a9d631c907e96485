/// How the yardsticks read depth images: the parameters, and what a raw depth says.
#pragma once

#include <cmath>
#include <string>
#include <tuple>

#include "config/config_text.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// The parameters that say how depth images are read.
struct DepthReading {
  double z_min = 0;           ///< [m]
  double z_max = 0;           ///< [m]
  int decimation = 1;         ///< [pixel]
  double depth_unit = 0.001;  ///< [m]
  bool carve_no_return = false;
  bool carve_beyond_range = false;
  bool means = false;                                                   ///< of the pixels around each: Config::sampling
  double noise = 0, noise_growth = 0, quantisation = 0, agreement = 0;  ///< see Config

  /// @throws Error if the numbers make no sense
  explicit DepthReading(const Config& config)
      : z_min(config.z_min),
        z_max(config.z_max),
        decimation(config.decimation),
        depth_unit(config.depth_unit),
        carve_no_return(config.carve_no_return),
        carve_beyond_range(config.carve_beyond_range),
        means(config.sampling == "mean"),
        noise(config.noise),
        noise_growth(config.noise_growth),
        quantisation(config.quantisation),
        agreement(config.agreement) {
    if (!(z_min > 0 && z_max > z_min && std::isfinite(z_max))) {
      throw Error("The depth range must be 0 < z_min < z_max, but is " + to_text(z_min) + " to " + to_text(z_max) + " m.");
    }
    if (!(depth_unit > 0 && std::isfinite(depth_unit))) {
      throw Error("The depth unit must be above 0, but is " + to_text(depth_unit) + " m.");
    }
    if (decimation < 1) throw Error("The decimation must be 1 or more, but is " + std::to_string(decimation) + ".");
    if (config.sampling != "mean" && config.sampling != "nearest") {
      throw Error("The sampling must be mean or nearest, but is '" + config.sampling + "'.");
    }
    if (!(noise >= 0 && noise_growth >= 0 && quantisation >= 0 && agreement >= 0)) {
      throw Error("The noise, noise_growth, quantisation and agreement of the sensor must not be negative, but are " + to_text(noise) +
                  ", " + to_text(noise_growth) + ", " + to_text(quantisation) + " and " + to_text(agreement) + ".");
    }
  }

  bool operator==(const DepthReading& other) const {
    const auto all = [](const DepthReading& r) {
      return std::tuple(r.z_min, r.z_max, r.decimation, r.depth_unit, r.carve_no_return, r.carve_beyond_range, r.means, r.noise,
                        r.noise_growth, r.quantisation, r.agreement);
    };
    return all(*this) == all(other);
  }
};

/// What a raw depth [m] says; see DecimatedDepth::depth. The limits are compared as floats, like the depths.
inline float meaning(float d, const DepthReading& reading) {
  const float z_min = static_cast<float>(reading.z_min), z_max = static_cast<float>(reading.z_max);
  if (d >= z_min && d <= z_max) return d;
  if (!(d > z_max)) return 0;
  return (std::isinf(d) ? reading.carve_no_return : reading.carve_beyond_range) ? -z_max : 0;
}

}  // namespace frontier_surfels::scoring
