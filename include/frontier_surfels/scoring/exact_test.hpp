/// The yardstick: exact membership in the space that the frames themselves have seen, and what it says of a map.
/// Independent of the mapper: it needs only the frames and a cloud of surfels, anybody's.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/scoring/scene_object.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// Shares between 0 and 1; doc/method.md defines each.
struct ExactScore {
  // Per surfel. right + buried + floating + flipped = 1.
  double right = 0;                     ///< not known(p - kBackProbe r n) and known(p + kFrontProbe r n)
  double buried = 0;                    ///< both known
  double floating = 0;                  ///< neither known
  double flipped = 0;                   ///< only the back one known
  double within_1v = 0, within_2v = 0;  ///< next unknown -> known step along +n at most 1, 2 voxels (r / 0.866) away
  double fdr_2cm = 0, fdr_5cm = 0;      ///< the same further away than 2, 5 cm
  // Per point of the exact boundary.
  double miss_1cm = 0, miss_2cm = 0, miss_5cm = 0;  ///< no surfel centre within that distance
  double label_ok = 0;                              ///< of those with a surfel within 2 cm: the nearest one's label is right
  std::size_t boundary_points = 0;
};

/// What is wrong with one surfel, for pictures.
enum class Verdict : std::uint8_t { kRight, kBuried, kFloating, kFlipped };

/// A point of the exact boundary, found by marching from known to not known.
struct BoundaryPoint {
  Eigen::Vector3d position;  ///< world [m]
  bool occupied = false;     ///< 3 mm further on a frame sees it at most 3 cm behind its measured surface
};

/// Something that was put down: what earlier frames have seen in its place does not count.
struct PlacedBox {
  OrientedBox box_world;
  std::size_t frames_before = 0;  ///< how many frames had been added before it stood there
};

class ExactView;  // what one frame has seen; private

class ExactTest {
 public:
  /// score() uses boundary(segments, kSeed), so that the scores of two maps can be compared.
  static constexpr std::uint64_t kSeed = 1;

  /// @param config  says how the mapper reads depth images: z_min, z_max, decimation, depth_unit and what is carved
  /// @throws Error  if these make no sense
  explicit ExactTest(const Config& config);
  ~ExactTest();
  ExactTest(ExactTest&&) noexcept;
  ExactTest& operator=(ExactTest&&) noexcept;

  /// Adds a frame; what it needs of the images is copied.
  /// @throws BadFrame if it has no image, camera or pose
  void add(const DepthFrame& frame);
  std::size_t size() const;

  /// Says what has been put down, in place of what was said before. Without any, the world is taken to be still.
  void set_placed(const std::vector<PlacedBox>& placed);

  /// known(p) <=> there is a frame m and its pixel q = round(pi(T_m^-1 p)) inside the image that has seen free space up to d, and
  /// 0 < z(T_m^-1 p) < d, and nothing was put down at p after it. Where z_min <= depth <= z_max, d is the depth. Where the depth is beyond
  /// z_max and the configuration carves such pixels, d is z_max. Other pixels have seen nothing.
  bool known(const Eigen::Vector3d& p_world) const;

  /// `segments` random rays: a random frame and valid pixel, a point at 2-98 % of its depth, a random direction; marched in 1 cm steps
  /// until not known (at most 2 z_max), bisected; dropped if any of the next four 5 mm steps is known again, and on faces of
  /// what was put down that no frame has seen since. The same seed gives the same points.
  /// @param threads  0: as many as the machine has; the points do not depend on it
  std::vector<BoundaryPoint> boundary(std::size_t segments, std::uint64_t seed, int threads = 0) const;

  /// The whole test. A surfel that is not finite counts as floating; where there is nothing to share out, shares are 0, but without any
  /// surfel all of the boundary is missed.
  /// @param progress  called now and then, on the calling thread, with a share between 0 and 1; if it returns false, Error is thrown
  /// @param verdicts  if not null: one per surfel
  ExactScore score(const std::vector<Surfel>& surfels, std::size_t segments = 40000, int threads = 0,
                   const std::function<bool(double)>& progress = {}, std::vector<Verdict>* verdicts = nullptr) const;

 private:
  Config config_;
  std::vector<ExactView> views_;
};

}  // namespace frontier_surfels::scoring
