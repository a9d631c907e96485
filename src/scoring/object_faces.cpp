#include "scoring/object_faces.hpp"

#include <algorithm>
#include <cmath>

#include "scoring/surfel_tree.hpp"

namespace frontier_surfels::scoring {

namespace {

constexpr double kSpacing = 0.01;          // [m] between neighbouring points of a face
constexpr double kInsideMargin = 0.001;    // [m] A point that lies closer to another box touches it.
constexpr double kDepthTolerance = 0.005;  // [m]
constexpr double kBoxMargin = 1e-3;        // [m] for rounding, around a box in which surfels are asked for

/// Adds the points of the two faces of a box across an axis.
void add_faces(const OrientedBox& box, int axis, std::vector<FacePoint>& points) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto cells = [&](int along) { return std::max(1, static_cast<int>(std::lround(2 * box.half_size[along] / kSpacing))); };
  for (const double side : {-1.0, 1.0}) {
    for (int i = 0; i < cells(u); ++i) {
      for (int j = 0; j < cells(v); ++j) {
        Eigen::Vector3d p;
        p[axis] = side * box.half_size[axis];
        p[u] = ((2 * i + 1.0) / cells(u) - 1) * box.half_size[u];
        p[v] = ((2 * j + 1.0) / cells(v) - 1) * box.half_size[v];
        points.push_back({box.T_frame_box * p, box.T_frame_box.linear() * (side * Eigen::Vector3d::Unit(axis))});
      }
    }
  }
}

}  // namespace

std::vector<FacePoint> face_points(const std::vector<OrientedBox>& boxes) {
  std::vector<FacePoint> points;
  for (const OrientedBox& box : boxes) {
    std::vector<FacePoint> own;
    for (int axis = 0; axis < 3; ++axis) add_faces(box, axis, own);
    for (const FacePoint& point : own) {
      const auto hides = [&](const OrientedBox& other) { return &other != &box && other.contains(point.position, kInsideMargin); };
      if (std::none_of(boxes.begin(), boxes.end(), hides)) points.push_back(point);
    }
  }
  return points;
}

double seen_cosine(const FacePoint& point_world, const DepthFrame& frame, const DepthReading& reading) {
  const Eigen::Vector3d to_camera = frame.T_world_camera.translation() - point_world.position;
  const double cosine = to_camera.dot(point_world.normal) / to_camera.norm();
  const Eigen::Vector3d p = frame.T_world_camera.linear().transpose() * -to_camera;
  const double z = p.z();
  if (!(cosine > 0 && z >= reading.z_min && z <= reading.z_max)) return 0;
  const Intrinsics& camera = frame.intrinsics;
  const double column = std::floor(camera.fx * p.x() / z + camera.cx + 0.5), row = std::floor(camera.fy * p.y() / z + camera.cy + 0.5);
  if (!(column >= 0 && column < camera.width && row >= 0 && row < camera.height)) return 0;
  const float depth = read_depth(frame.depth, static_cast<int>(column), static_cast<int>(row), reading.depth_unit);
  // The centre of the pixel may lie a pixel from the point, where the face is that much nearer.
  const double tolerance = kDepthTolerance + z / std::min(camera.fx, camera.fy) / cosine;
  return depth >= z - tolerance ? cosine : 0;
}

StandRecord::StandRecord(const SceneObject& object, const Stand& stand)
    : stand_(stand), points_(face_points(object.placed(stand))), views_(points_.size()) {
  for (const FacePoint& point : points_) near_.extend(point.position);
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(ObjectTest::kCoverDistance + kBoxMargin);
  near_ = Eigen::AlignedBox3d(near_.min() - margin, near_.max() + margin);
}

void StandRecord::add(std::size_t index, const DepthFrame& ideal, const DepthReading& reading, const ObjectTest::SurfelsIn& surfels_in) {
  if (first_seen_) ++frames_since_;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const double cosine = seen_cosine(points_[i], ideal, reading);
    for (std::size_t c = 0; c < kCosines; ++c) views_[i][c] += cosine > ObjectTest::kCosines[c];
    if (cosine > ObjectTest::kCosines[0] && !first_seen_) first_seen_ = index;
  }
  if (!surfels_in || !first_seen_) return;
  if (frames_since_ < ObjectTest::kEarlyFrames) return;
  latest_ = covered(surfels_in);  // any frame may be the last one of the stand
  if (frames_since_ == ObjectTest::kEarlyFrames) early_ = latest_;
}

StandRecord::AllCovered StandRecord::covered(const ObjectTest::SurfelsIn& surfels_in) const {
  std::vector<Surfel> occupied = surfels_in(near_);
  occupied.erase(std::remove_if(occupied.begin(), occupied.end(), [](const Surfel& surfel) { return surfel.label != Label::kOccupied; }),
                 occupied.end());
  const SurfelTree tree(occupied);
  AllCovered result;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!counts(i, kCosines - 1)) continue;  // the smallest cosine
    const bool is_covered = tree.nearest(points_[i].position).distance <= ObjectTest::kCoverDistance;
    for (std::size_t c = 0; c < kCosines; ++c) {
      if (!counts(i, c)) continue;
      ++result[c].points;
      result[c].share += is_covered;
    }
  }
  for (FacesCovered& covered : result) covered.share /= static_cast<double>(std::max<std::size_t>(covered.points, 1));
  return result;
}

StandScore StandRecord::score(const ObjectTest::SurfelsIn& surfels_in) const {
  StandScore score;
  score.first = stand_.first;
  score.last = stand_.last;
  score.first_seen = first_seen_;
  const std::optional<AllCovered> end = surfels_in ? covered(surfels_in) : latest_;
  for (std::size_t c = 0; c < kCosines; ++c) {
    FacesScore faces;
    faces.cosine = ObjectTest::kCosines[c];
    if (end) faces.end = (*end)[c];
    if (early_) faces.early = (*early_)[c];
    score.faces.push_back(faces);
  }
  return score;
}

}  // namespace frontier_surfels::scoring
