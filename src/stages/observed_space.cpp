#include "stages/observed_space.hpp"

namespace frontier_surfels {

ObservedSpace::ObservedSpace(Commands& commands) : commands_(commands), column_end_(commands), valid_(commands), observed_(commands) {}

void ObservedSpace::compute(const Camera& camera) {
  const char* stage = "observed_space";
  const Grid& g = camera.grid();
  const std::size_t image_words = (g.width + 31) / 32 * static_cast<std::size_t>(g.height);
  column_end_.resize(static_cast<std::size_t>(g.width) * g.height);
  valid_.resize(image_words);
  observed_.allocate(words(g) + SPARE_WORDS);
  if (commands_.lanes() == 1) valid_.fill(stage, 0, image_words);  // work items share words then
  commands_.run(stage, "column_ends", 32 / commands_.lanes() * image_words, kGroup, g, camera.depth()(), camera.layer_depth()(),
                column_end_(), valid_());
  const std::size_t rows = (g.size_j + SPACE_ROWS - 1) / SPACE_ROWS,
                    group = commands_.shape().many_items ? commands_.shape().tile_group : commands_.shape().heavy_group,
                    items = commands_.shape().many_items ? group * 2 * g.words_k * g.size_j : commands_.chunks(g.size_i) * g.words_k * rows;
  commands_.run(stage, "observed_space", items, group, g, column_end_(), valid_(), camera.pixels_i()(), camera.pixels_j()(),
                camera.words_i()(), observed_());
}

}  // namespace frontier_surfels
