/// Things in the synthetic room that come, go or move.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frontier_surfels/scoring/scene_object.hpp"

namespace frontier_surfels::replay {

/// What happens in the room.
enum class Scene {
  kRoom,         ///< nothing
  kBoxAppears,   ///< a box stands on the table from the middle of the recording on
  kBoxVanishes,  ///< it stands there up to the middle
  kBoxReturns,   ///< it stands there in the first and the last third
  kPersonWalks,  ///< somebody comes through the door, walks along the table, and leaves again
};

struct SceneThing {
  scoring::SceneObject object;
  std::vector<std::array<std::uint8_t, 3>> rgb;  ///< of each part
};

/// @param frames  number of frames of the whole recording
std::vector<SceneThing> scene_things(Scene scene, int frames);

}  // namespace frontier_surfels::replay
