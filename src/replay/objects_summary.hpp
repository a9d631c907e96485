/// What the scores say of the truth's objects: for summary.json, and for a terminal.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "frontier_surfels/scoring/object_test.hpp"

namespace frontier_surfels::replay {

/// `objects` of summary.json; doc/method.md defines the figures. Those that there are none of are absent.
nlohmann::ordered_json objects_json(const std::vector<scoring::ObjectScore>& scores);

/// A line for each stand and each object that has left a place. @param objects  as objects_json() makes it
std::string objects_table(const nlohmann::ordered_json& objects);

}  // namespace frontier_surfels::replay
