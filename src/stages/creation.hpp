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
  /// @return number of chosen candidates
  std::size_t filter(const Frame& frame, const CandidateList& list, const Candidates& candidates, const BitField* known);

  /// Makes surfels of the chosen candidates and puts them into the map.
  void create(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
              const ViewSettling& settling, const CandidateList& list, SurfelMap& map);

  std::size_t count() const { return count_; }
  const DeviceArray<cl_uint>& chosen() const { return chosen_; }  ///< [count]: place of each in the list of candidates, ascending
  const NewSurfels& new_surfels() const { return new_; }

 private:
  Commands& commands_;
  Lists& lists_;
  std::size_t count_ = 0;
  BitField kept_;  ///< a bit for each listed candidate
  DeviceArray<cl_uint> chosen_;
  NewSurfels new_;
};

}  // namespace frontier_surfels
