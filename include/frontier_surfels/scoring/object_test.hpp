/// How soon and how completely a map shows things that appear, and what it keeps of things that have gone.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/scoring/scene_object.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// Points of an object's faces, about 1 cm apart.
struct FacesCovered {
  std::size_t points = 0;  ///< that kFewestViews frames have seen at a larger cosine of the angle between ray and normal than asked for
  double share = 0;        ///< of these: with the centre of an occupied surfel within kCoverDistance
};

struct FacesScore {
  double cosine = 0;                  ///< one of kCosines
  std::optional<FacesCovered> early;  ///< kEarlyFrames frames after the first view
  std::optional<FacesCovered> end;    ///< after the last frame of the stand, or at the end
};

/// An object during the frames in which it stands still.
struct StandScore {
  std::size_t first = 0, last = 0;        ///< frames, as in Stand
  std::optional<std::size_t> first_seen;  ///< the first frame that has seen a point of a face
  std::vector<FacesScore> faces;          ///< for each of kCosines
};

/// Surfels that are left where an object stood: within kLeftDistance of the place, although kSettleFrames frames ago it was already seen
/// that the space kLeftDistance around the surfel is empty since the object has gone.
struct LeftSurfels {
  std::size_t occupied = 0, frontier = 0;
};

struct ObjectScore {
  std::string name;
  std::vector<StandScore> stands;        ///< those of more than kEarlyFrames frames
  std::optional<LeftSurfels> left;       ///< at the end; none if it has never left a place
  std::optional<LeftSurfels> most_left;  ///< the most of each in any frame
};

class ObjectTest {
 public:
  static constexpr double kCosines[] = {0.17, 0.1};
  static constexpr std::size_t kFewestViews = 4;
  static constexpr double kCoverDistance = 0.02;  ///< [m]
  static constexpr std::size_t kEarlyFrames = 8;
  static constexpr double kLeftDistance = 0.02;  ///< [m]
  static constexpr std::size_t kSettleFrames = 10;

  /// The surfels of a map in a box of the world frame.
  using SurfelsIn = std::function<std::vector<Surfel>(const Eigen::AlignedBox3d&)>;

  /// @param config  says how the mapper reads depth images
  /// @throws Error  if that makes no sense
  ObjectTest(const Config& config, std::vector<SceneObject> objects);
  ~ObjectTest();
  ObjectTest(ObjectTest&&) noexcept;
  ObjectTest& operator=(ObjectTest&&) noexcept;

  const std::vector<SceneObject>& objects() const;

  /// Adds a frame after the mapper has taken it.
  /// @param index       of the frame in the recording, larger than that of the frame before
  /// @param ideal       what an ideal sensor has seen, at the true pose
  /// @param surfels_in  the map after the frame; if empty, there are no early and no most figures
  /// @throws BadFrame   if the frame has no image, camera or pose
  void add(std::size_t index, const DepthFrame& ideal, const SurfelsIn& surfels_in);

  /// What there is to say after the last frame. @param surfels_in  the map then
  std::vector<ObjectScore> score(const SurfelsIn& surfels_in) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels::scoring
