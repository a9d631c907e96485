#include "stages/observed_space.hpp"

namespace frontier_surfels {

ObservedSpace::ObservedSpace(Commands& commands) : commands_(commands), column_end_(commands), valid_(commands), observed_(commands) {}

void ObservedSpace::compute(const Frame& frame, const Camera& camera) {
  const char* stage = "observed_space";
  const Grid& g = frame.grid;
  const std::size_t image_chunks = 2 * ((g.width + 31) / 32) * static_cast<std::size_t>(g.height);  // an even number in each row
  column_end_.resize(static_cast<std::size_t>(g.width) * g.height);
  valid_.resize(image_chunks);
  observed_.allocate(words(g) + LANES);  // vectors are read beyond the end of the last row
  commands_.run(stage, "column_ends", image_chunks, kGroup, g, camera.depth()(), camera.layer_depth()(), column_end_(), valid_());
  const std::size_t rows = (g.size_j + SPACE_ROWS - 1) / SPACE_ROWS;
  commands_.run(stage, "observed_space", chunks(g.size_i) * g.words_k * rows, commands_.device().heavy_group(), g, column_end_(), valid_(),
                camera.pixels_i()(), camera.pixels_j()(), camera.words_i()(), observed_());
}

}  // namespace frontier_surfels
