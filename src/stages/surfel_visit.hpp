/// The pass over the surfels around the view; kernels/stages/5_visit.cl. It finds the surfels that the grid sees, those of them that are
/// too large - paper 3.4 - and those to be removed - eq. (12). Surfels to be labelled are marked as changed in the map.
#pragma once

#include "map/surfel_map.hpp"
#include "stages/candidates.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

class SurfelVisit {
 public:
  struct Found {
    std::size_t in_view = 0, large = 0, removed = 0;  ///< numbers of surfels
    bool goes_on = false;                             ///< SurfelMap::go_ahead() was called, and the device has gone on
  };

  explicit SurfelVisit(Commands& commands);

  /// Clears the candidates in the voxels of surfels that stay. No surfel leaves the map yet.
  /// @param observed, column_end  of ObservedSpace
  /// @param taken                 TakingBack::taken()
  /// @param candidates            as Candidates::find() has left them
  void visit(const Frame& frame, const Camera& camera, const BitField& observed, const DeviceArray<cl_int>& column_end,
             const RecentViews& views, const SeenPoints& taken, const SurfelMap& map, Candidates& candidates);

  /// Waits for the device. Tells the map how many surfels were marked; must be called once after each visit().
  static Found read_found(Candidates& candidates, SurfelMap& map);

  /// @name A word for each page of the map's window, a bit for each surfel
  /// @{
  const BitField& in_view() const { return in_view_; }  ///< the surfel touches the grid
  const BitField& large() const { return large_; }      ///< it must be split
  const BitField& removed() const {
    return removed_;
  }  ///< it is to leave the map
     /// @}

 private:
  Commands& commands_;
  BitField in_view_, large_, removed_;
};

}  // namespace frontier_surfels
