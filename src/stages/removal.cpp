#include "stages/removal.hpp"

namespace frontier_surfels {

void remove_surfels(Commands& commands, const BitField& removed, std::size_t count, SurfelMap& map) {
  const std::size_t pages = map.window_pages();
  map.back_up("removal", removed, count);
  commands.run("removal", "remove_surfels", pages, kGroup, map.goes_on(), map.pages(), static_cast<cl_uint>(pages), removed(), map.alive(),
               map.changed());
  map.removed(count);
}

void label_surfels(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end, SurfelMap& map) {
  const std::size_t pages = map.pages_to_change();
  commands.run("labels", "label_surfels", PAGE_SLOTS / commands.lanes() * pages, PAGE_GROUP, map.goes_on(), frame, camera.depth()(),
               column_end(), camera.color()(), map.pages(), static_cast<cl_uint>(pages), map.alive(), map.changed(), map.page_block(),
               map.surfels());
}

}  // namespace frontier_surfels
