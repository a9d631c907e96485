/// New surfel filter and creation - paper 3.5, eq. (14)-(16); kernels/stages/15_new_surfel_filter.cl and 17_creation.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "opencl/lists.hpp"
#include "stages/candidates.hpp"
#include "stages/frame.hpp"
#include "stages/new_surfels.hpp"
#include "stages/view_settling.hpp"

namespace frontier_surfels {

class Creation {
 public:
  Creation(Commands& commands, Lists& lists);

  /// Chooses the candidates that become surfels: candidates that are not known and have a direction.
  /// @param known  K~ of the paper's section 3.2; null if the kept views have settled all candidates
  void filter(const Frame& frame, const CandidateList& list, const Candidates& candidates, const BitField* known);

  /// Makes surfels of the chosen candidates. The map does not change yet. @param leaving  SurfelVisit::removed()
  void create(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
              const ViewSettling& settling, const CandidateList& list, const BitField& leaving, SurfelMap& map);

  /// Puts them into the map once the leaving ones have left it: when the host knows how many there are, or after SurfelMap::go_ahead().
  void insert(SurfelMap& map) const;

  DeviceList& chosen() { return chosen_; }  ///< place of each in the list of candidates, ascending
  const DeviceList& chosen() const { return chosen_; }
  const NewSurfels& new_surfels() const { return new_; }

 private:
  Commands& commands_;
  Lists& lists_;
  BitField kept_;  ///< a bit for each listed candidate
  DeviceList chosen_;
  NewSurfels new_;
  bool is_sorted_ = false;  ///< the map has sorted them
};

}  // namespace frontier_surfels
