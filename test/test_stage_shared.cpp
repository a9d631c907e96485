/// kernels/common/shared.h: the structures have the same layout on host and device.

#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>

#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

/// Fields of each structure. The same lists make the host's offsets and the device's probe kernels.
// clang-format off
#define GRID_FIELDS(F) \
  F(size_i)            \
  F(size_j)            \
  F(size_k)            \
  F(words_k)           \
  F(width)             \
  F(height)            \
  F(padding_i)         \
  F(padding_j) F(padding_k) F(first_pyramid_layer) F(fx) F(fy) F(f) F(center_i) F(center_j) F(k_min) F(z_min) F(z_max) F(delta_min)
#define TRANSFORM_FIELDS(F) F(r00) F(r01) F(r02) F(r10) F(r11) F(r12) F(r20) F(r21) F(r22) F(t0) F(t1) F(t2)
#define WINDOW_FIELDS(F) F(origin_x) F(origin_y) F(origin_z) F(size_x) F(size_y) F(size_z) F(block_size)
#define VIEW_FIELDS(F)                                                                                                                    \
  F(to_image.r00) F(to_image.r01) F(to_image.r02) F(to_image.r10) F(to_image.r11) F(to_image.r12) F(to_image.r20) F(to_image.r21)         \
  F(to_image.r22) F(to_image.t0) F(to_image.t1) F(to_image.t2) F(width) F(height) F(first_pixel) F(depth_step)
#define VIEW_SURFEL_FIELDS(F) F(i) F(j) F(k) F(reach) F(n_x) F(n_y) F(n_z) F(n_k) F(ray_x) F(ray_y) F(slot) F(ragged)
#define LIMITS_FIELDS(F) \
  F(th_d) F(peak) F(thickness) F(hull_unknown_scale) F(split_radius) F(create_radius) F(normal_min) F(back_probe) F(front_probe) F(min_gap) F(surface_depth) F(median_votes) F(remove_buried) F(refine)
// clang-format on

#define NAME(field) #field,
#define NAMES(FIELDS) std::vector<std::string>({FIELDS(NAME)})

/// Source of a kernel that probes a structure. It returns the size, each field's offset and each field's bits of a structure that is passed
/// by value, and then each field's bits of the second element of a buffer.
std::string probe_source(const std::string& type, const std::vector<std::string>& fields) {
  const std::string put = "  out[n++] = ";
  std::string text = "__kernel void probe_" + type + "(__global uint* out, __global const " + type + "* in, const " + type + " value) {\n";
  text += "  int n = 0;\n  " + type + " copy = value;\n" + put + "(uint)sizeof(" + type + ");\n";
  for (const auto& field : fields) text += put + "(uint)((__private char*)&copy." + field + " - (__private char*)&copy);\n";
  for (const auto& field : fields) text += put + "*(__private uint*)&copy." + field + ";\n";
  for (const auto& field : fields) text += put + "*(__global const uint*)&in[1]." + field + ";\n";
  return text + "}\n";
}

TestKernels& probes() {
  static auto* const kernels =
      new TestKernels(probe_source("Grid", NAMES(GRID_FIELDS)) + probe_source("Transform", NAMES(TRANSFORM_FIELDS)) +
                      probe_source("Window", NAMES(WINDOW_FIELDS)) + probe_source("View", NAMES(VIEW_FIELDS)) +
                      probe_source("ViewSurfel", NAMES(VIEW_SURFEL_FIELDS)) + probe_source("Limits", NAMES(LIMITS_FIELDS)) +
                      probe_source("Frame", {"grid.size_i", "limits.th_d", "window.origin_x", "T_camera_local.r00", "T_local_camera.r00",
                                             "own_view.width", "has_color"}));
  return *kernels;
}

template <typename T>
void check(const std::string& type, const std::vector<std::string>& fields, const std::vector<std::size_t>& offsets) {
  static_assert(sizeof(T) % 4 == 0);
  std::vector<T> values(2);
  std::vector<std::uint32_t> bits(2 * sizeof(T) / 4);
  for (std::size_t n = 0; n < bits.size(); ++n) bits[n] = 0x3f000000u + 0x1357u * static_cast<std::uint32_t>(n);
  std::memcpy(values.data(), bits.data(), 2 * sizeof(T));

  const auto out = probes().run<cl_uint>(("probe_" + type).c_str(), 1, values, 1 + 3 * fields.size(), values[0]);
  EXPECT_EQ(out[0], sizeof(T));
  for (std::size_t n = 0; n < fields.size(); ++n) {
    EXPECT_EQ(out[1 + n], offsets[n]) << "offset of " << fields[n];
    EXPECT_EQ(out[1 + fields.size() + n], bits[offsets[n] / 4]) << "value of " << fields[n];
    EXPECT_EQ(out[1 + 2 * fields.size() + n], bits[(sizeof(T) + offsets[n]) / 4]) << "in a buffer: value of " << fields[n];
  }
}

/// Checks a structure whose fields are all listed.
template <typename T>
void check_all(const std::string& type, const std::vector<std::string>& fields, const std::vector<std::size_t>& offsets) {
  ASSERT_EQ(4 * fields.size(), sizeof(T)) << "a field is missing in this test";
  check<T>(type, fields, offsets);
}

TEST(StageShared, Grid) {
#define OFFSET(field) offsetof(Grid, field),
  check_all<Grid>("Grid", NAMES(GRID_FIELDS), {GRID_FIELDS(OFFSET)});
#undef OFFSET
}

TEST(StageShared, Transform) {
#define OFFSET(field) offsetof(Transform, field),
  check_all<Transform>("Transform", NAMES(TRANSFORM_FIELDS), {TRANSFORM_FIELDS(OFFSET)});
#undef OFFSET
}

TEST(StageShared, Window) {
#define OFFSET(field) offsetof(Window, field),
  check_all<Window>("Window", NAMES(WINDOW_FIELDS), {WINDOW_FIELDS(OFFSET)});
#undef OFFSET
}

TEST(StageShared, View) {
#define OFFSET(field) offsetof(View, field),
  check_all<View>("View", NAMES(VIEW_FIELDS), {VIEW_FIELDS(OFFSET)});
#undef OFFSET
}

TEST(StageShared, ViewSurfel) {
#define OFFSET(field) offsetof(ViewSurfel, field),
  check_all<ViewSurfel>("ViewSurfel", NAMES(VIEW_SURFEL_FIELDS), {VIEW_SURFEL_FIELDS(OFFSET)});
#undef OFFSET
}

TEST(StageShared, Limits) {
#define OFFSET(field) offsetof(Limits, field),
  check_all<Limits>("Limits", NAMES(LIMITS_FIELDS), {LIMITS_FIELDS(OFFSET)});
#undef OFFSET
}

/// The structures of a Frame lie in it as they lie alone, one behind the other.
TEST(StageShared, Frame) {
  const std::vector<std::string> fields = {"grid.size_i",        "limits.th_d",    "window.origin_x", "T_camera_local.r00",
                                           "T_local_camera.r00", "own_view.width", "has_color"};
  const std::vector<std::size_t> offsets = {offsetof(Frame, grid.size_i),        offsetof(Frame, limits.th_d),
                                            offsetof(Frame, window.origin_x),    offsetof(Frame, T_camera_local.r00),
                                            offsetof(Frame, T_local_camera.r00), offsetof(Frame, own_view.width),
                                            offsetof(Frame, has_color)};
  check<Frame>("Frame", fields, offsets);
}

}  // namespace
}  // namespace frontier_surfels
