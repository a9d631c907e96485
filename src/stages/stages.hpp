/// The boxes of the paper's flow chart on the device: buffers and launches. The only place that names kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "common/shared.h"
#include "frame/recent_views.hpp"
#include "frame/view_grid.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "opencl/lists.hpp"

namespace frontier_surfels {

class Stages {
 public:
  Stages(Commands& commands, Lists& lists, const Config& config, SurfelMap& map, RecentViews& views);

  /// Takes a frame's camera. @return distance from it along an axis within which the frame asks for blocks of the map [m]
  double set_camera(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera);

  /// Sends a frame's image and, where the camera has changed, its grid. @param frame  number that changed surfels get
  void begin_frame(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint32_t frame);

  void observe_space();    ///< C~
  void find_candidates();  ///< voxels for new surfels by C~
  /// After find_candidates(). Notes which surfels must be split, removed, those in observed space, and of the others labelled. Voxels of
  /// these are no candidates.
  /// @return surfels that touch the grid
  std::size_t select_in_view();
  std::size_t split_surfels();                         ///< @return surfels that this adds to the map
  bool is_open() const { return !views_.complete(); }  ///< whether section 4 has anything left to decide
  void compute_sign_field();                           ///< events of D
  void compute_known_hull();                           ///< states in which paths enter the grid
  void sweep_paths();                                  ///< K'
  void filter_median();                                ///< K~
  void settle_by_recent_views();                       ///< candidates that a kept view knows are dropped
  void filter_candidates();                            ///< candidates that are known, or without a normal, are dropped
  std::size_t remove_surfels();  ///< @return how many; device memory for what create_surfels adds is made sure of before
  std::size_t create_surfels();  ///< @return how many
  void label_surfels();          ///< new ones, and those that select_in_view has noted

  std::vector<BlockKey> finish_frame();  ///< notes what has changed in the map. @return blocks that have lost pages

 private:
  friend class StagesProbe;  // tests read and write the fields between stages

  std::size_t words() const { return static_cast<std::size_t>(grid_.size_i) * grid_.size_j * grid_.words_k; }
  std::size_t candidate_words() const;
  std::size_t line_numbers() const {
    return 2 * static_cast<std::size_t>(grid_.size_i + grid_.size_j) * grid_.words_k +
           static_cast<std::size_t>(grid_.size_i) * grid_.size_j;
  }
  std::vector<cl_uint> visit_surfels();  ///< @return the counts
  void place_surfels();
  void list_candidates();  ///< and the direction to the observed space around each
  void set_grid(const WorkingImage& image);
  void allocate_grid();
  void allocate_paths();
  std::size_t image_words() const;  ///< of 32 pixels of a row each
  std::size_t large_group() const;  ///< work items of a group where one item has much to do

  Commands& commands_;
  Lists& lists_;
  SurfelMap& map_;
  RecentViews& views_;
  Config config_;
  Limits limits_;

  // This frame
  Intrinsics intrinsics_ = {};  // of the working image that the grid is for
  Grid grid_ = {};
  Transform T_camera_local_ = {}, T_local_camera_ = {};
  Window window_ = {};
  std::uint32_t frame_ = 0;
  bool has_color_ = false;
  std::size_t large_ = 0, removed_ = 0, in_view_ = 0, listed_count_ = 0, created_count_ = 0;

  // Image and grid
  SentArray<float> depth_;
  SentArray<cl_uint> color_;
  DeviceArray<float> layer_depth_;
  DeviceArray<cl_int> column_end_;
  DeviceArray<cl_uint> valid_;
  DeviceArray<PixelRange> pixels_i_, pixels_j_, words_i_;

  // Bit fields
  DeviceArray<cl_ulong> observed_, events_, hull_, known_, filtered_, candidates_;
  DeviceArray<cl_uint> hull_faces_, lines_;
  DeviceArray<cl_ushort> tile_views_;

  // Candidates as a list, and new surfels
  DeviceArray<cl_uint> listed_voxels_, created_;
  DeviceArray<cl_ulong> kept_bits_;
  DeviceArray<cl_int> around_;
  DeviceArray<float> directions_;

  // Surfels in view
  DeviceArray<cl_uint> counts_;
  DeviceArray<cl_ulong> in_view_bits_, large_bits_, removed_bits_;
  DeviceArray<cl_uint> in_view_slots_, split_slots_, split_offsets_;
  DeviceArray<ViewSurfel> view_surfels_;
  DeviceArray<cl_uint4> new_surfels_;
  DeviceArray<cl_uint> new_cells_, near_pages_;
  DeviceArray<cl_uint> tile_begin_, tile_cursor_, tile_surfels_;
};

}  // namespace frontier_surfels
