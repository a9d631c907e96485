#include "frontier_surfels/scoring/octomap_truth.hpp"

#include <octomap/octomap.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <future>
#include <map>
#include <utility>

#include "config/config_text.hpp"
#include "scoring/cpu_clock.hpp"
#include "scoring/octomap_cloud.hpp"
#include "scoring/surfel_tree.hpp"

namespace frontier_surfels::scoring {

namespace {

using octomap::OcTree;
using octomap::OcTreeKey;

constexpr int kTreeDepth = 16;
constexpr int kKeys = 1 << kTreeDepth;  ///< along an axis

/// A voxel of the finest level.
using Voxel = std::array<int, 3>;

/// The node that holds a voxel, null if it is unknown.
const octomap::OcTreeNode* find(const OcTree& tree, const Voxel& voxel) {
  for (const int k : voxel) {
    if (k < 0 || k >= kKeys) return nullptr;
  }
  return tree.search(OcTreeKey(voxel[0], voxel[1], voxel[2]));
}

/// An unknown voxel beside a known one, as a number: sorted by voxel, and the last of equal voxels tells of any occupied neighbour.
std::uint64_t pack(const Voxel& v, bool beside_occupied) {
  const auto key = [&](int axis) { return static_cast<std::uint64_t>(v[axis]); };
  return (key(0) << 32 | key(1) << 16 | key(2)) << 1 | (beside_occupied ? 1 : 0);
}

Voxel unpack(std::uint64_t packed) {
  const auto key = [&](int shift) { return static_cast<int>(packed >> shift & (kKeys - 1)); };
  return {key(33), key(17), key(1)};
}

/// Appends the unknown voxels that touch a face of a leaf. A leaf may be a pruned one, a cube of many voxels.
void unknown_beside(const OcTree& tree, const Voxel& low, int size, bool occupied, std::vector<std::uint64_t>& unknown) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {low[axis] - 1, low[axis] + size}) {
      if (side < 0 || side >= kKeys) continue;
      Voxel v;
      v[axis] = side;
      const int a = (axis + 1) % 3, b = (axis + 2) % 3;
      for (v[a] = low[a]; v[a] < low[a] + size; ++v[a]) {
        for (v[b] = low[b]; v[b] < low[b] + size; ++v[b]) {
          if (!find(tree, v)) unknown.push_back(pack(v, occupied));
        }
      }
    }
  }
}

/// Into known space. Where the known neighbours are opposite each other there is no such direction: then the z axis, as good as any.
Eigen::Vector3f normal_at(const OcTree& tree, const Voxel& v) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      for (int k = -1; k <= 1; ++k) {
        if ((i || j || k) && find(tree, {v[0] + i, v[1] + j, v[2] + k})) sum += Eigen::Vector3d(i, j, k).normalized();
      }
    }
  }
  return sum.norm() < 1e-6 ? Eigen::Vector3f::UnitZ() : sum.normalized().cast<float>().eval();
}

std::size_t count_far(const std::vector<Surfel>& surfels, const SurfelTree& tree, double tolerance) {
  return std::count_if(surfels.begin(), surfels.end(),
                       [&](const Surfel& surfel) { return tree.nearest(surfel.position.cast<double>()).distance > tolerance; });
}

/// Like insertPointCloud, with rays that end in free space. A voxel is updated once, and occupied ones go first.
void insert_with_free_rays(OcTree& tree, const OctomapClouds& clouds, const octomap::point3d& origin) {
  octomap::KeySet free, occupied;
  tree.computeUpdate(clouds.surface, origin, free, occupied, -1);
  octomap::KeyRay ray;
  for (const octomap::point3d& end : clouds.free_space) {
    if (!tree.computeRayKeys(origin, end, ray)) continue;
    for (const OcTreeKey& key : ray)
      if (occupied.count(key) == 0) free.insert(key);
  }
  for (const OcTreeKey& key : free) tree.updateNode(key, false);
  for (const OcTreeKey& key : occupied) tree.updateNode(key, true);
}

/// What the insertion takes of the calling thread.
InsertionTime insert(OcTree& tree, const OctomapClouds& clouds, const octomap::point3d& origin) {
  const auto start = std::chrono::steady_clock::now();
  const double cpu_before_ms = cpu_ms(CLOCK_THREAD_CPUTIME_ID);
  // No range limit (the depths have one), no lazy evaluation, no merging of rays: every ray is cast and the tree is pruned at once, as
  // octomap_server does.
  if (clouds.free_space.size() == 0) {
    tree.insertPointCloud(clouds.surface, origin, -1, false, false);
  } else {
    insert_with_free_rays(tree, clouds, origin);
  }
  return {std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count(),
          cpu_ms(CLOCK_THREAD_CPUTIME_ID) - cpu_before_ms};
}

}  // namespace

struct OctomapTruth::Impl {
  OcTree tree;
  DepthReading reading;
};

OctomapTruth::OctomapTruth(double resolution, const Config& config) {
  if (!(resolution > 0 && std::isfinite(resolution))) {
    throw Error("The resolution of the OctoMap must be above 0, but is " + to_text(resolution) + " m.");
  }
  const DepthReading reading(config);
  impl_.reset(new Impl{OcTree(resolution), reading});
}

OctomapTruth::~OctomapTruth() = default;

InsertionTime OctomapTruth::add(const DepthFrame& frame) {
  const OctomapClouds clouds = to_octomap_clouds(frame, impl_->reading);
  // A thread has a heap of its own. In the caller's, every allocation would search the great many small nodes that the tree has freed:
  // the mapper's frames between two insertions took 30 ms longer.
  return std::async(std::launch::async, [&] { return insert(impl_->tree, clouds, octomap_origin(frame)); }).get();
}

std::vector<Surfel> OctomapTruth::boundary() const {
  const OcTree& tree = impl_->tree;
  std::vector<std::uint64_t> unknown;
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    const OcTreeKey low = leaf.getIndexKey();
    unknown_beside(tree, {low[0], low[1], low[2]}, 1 << (kTreeDepth - leaf.getDepth()), tree.isNodeOccupied(*leaf), unknown);
  }
  std::sort(unknown.begin(), unknown.end());

  std::vector<Surfel> surfels;
  for (std::size_t i = 0; i < unknown.size(); ++i) {
    if (i + 1 < unknown.size() && unknown[i] >> 1 == unknown[i + 1] >> 1) continue;
    const Voxel v = unpack(unknown[i]);
    Surfel surfel;
    for (int axis = 0; axis < 3; ++axis)
      surfel.position[axis] = static_cast<float>(tree.keyToCoord(static_cast<octomap::key_type>(v[axis])));
    surfel.normal = normal_at(tree, v);
    surfel.radius = static_cast<float>(kNewRadius * tree.getResolution());
    surfel.label = unknown[i] & 1 ? Label::kOccupied : Label::kFrontier;
    surfel.id = static_cast<std::uint32_t>(surfels.size());
    surfels.push_back(surfel);
  }
  return surfels;
}

StateChanges OctomapTruth::states(std::uint64_t sequence) const {
  const OcTree& tree = impl_->tree;
  std::map<std::array<std::int32_t, 3>, std::vector<std::uint8_t>> blocks;
  const auto set = [&](const Voxel& v, bool occupied) {
    constexpr int kEdge = StateBlock::kEdge, kMiddle = kKeys / 2;  // of the keys, where the world has its origin
    const Voxel cell = {v[0] - kMiddle, v[1] - kMiddle, v[2] - kMiddle};
    std::vector<std::uint8_t>& cells = blocks[{cell[0] >> 4, cell[1] >> 4, cell[2] >> 4}];
    cells.resize(StateBlock::kBytes);
    const int n = (cell[0] & 15) + kEdge * (cell[1] & 15) + kEdge * kEdge * (cell[2] & 15);
    cells[(occupied ? StateBlock::kBytes / 2 : 0) + static_cast<std::size_t>(n) / 8] |= static_cast<std::uint8_t>(1 << n % 8);
  };
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    const OcTreeKey low = leaf.getIndexKey();
    const int size = 1 << (kTreeDepth - leaf.getDepth());
    for (int x = 0; x < size; ++x)
      for (int y = 0; y < size; ++y)
        for (int z = 0; z < size; ++z) set({low[0] + x, low[1] + y, low[2] + z}, tree.isNodeOccupied(*leaf));
  }
  StateChanges all = {sequence, 0, tree.getResolution(), {}};
  for (auto& [block, cells] : blocks) all.blocks.push_back({block, std::move(cells)});
  return all;
}

OctomapScore OctomapTruth::score(const std::vector<Surfel>& psi, const std::vector<Surfel>& m, double tolerance) const {
  OctomapScore score;
  score.surfels = m.size();
  score.fp = count_far(psi, SurfelTree(m), tolerance);
  score.fn = count_far(m, SurfelTree(psi), tolerance);
  score.fdr = psi.empty() ? 0 : static_cast<double>(score.fp) / psi.size();
  score.for_ = m.empty() ? 0 : static_cast<double>(score.fn) / m.size();
  return score;
}

double OctomapTruth::memory_mb() const { return impl_->tree.memoryUsage() / 1e6; }

}  // namespace frontier_surfels::scoring
