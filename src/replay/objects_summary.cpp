#include "replay/objects_summary.hpp"

#include <algorithm>

#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels::replay {

using nlohmann::ordered_json;
using scoring::FacesScore;
using scoring::LeftSurfels;
using scoring::ObjectScore;
using scoring::StandScore;

namespace {

constexpr std::size_t kTitleWidth = 12;  // of the other lines of the table

ordered_json faces_json(const FacesScore& faces) {
  ordered_json json = {{"cosine", faces.cosine}};
  if (faces.early) json.update({{"early_points", faces.early->points}, {"early_covered", faces.early->share}});
  if (faces.end) json.update({{"points", faces.end->points}, {"covered", faces.end->share}});
  return json;
}

ordered_json stand_json(const StandScore& stand) {
  ordered_json json = {{"first", stand.first}, {"last", stand.last}};
  if (stand.first_seen) json["first_seen"] = *stand.first_seen;
  json["faces"] = ordered_json::array();
  for (const FacesScore& faces : stand.faces) json["faces"].push_back(faces_json(faces));
  return json;
}

ordered_json left_json(const LeftSurfels& left) { return {{"occupied", left.occupied}, {"frontier", left.frontier}}; }

std::string title(const std::string& name) { return name + std::string(std::max(name.size() + 1, kTitleWidth) - name.size(), ' '); }

std::string number_text(const ordered_json& json) { return std::to_string(json.get<std::size_t>()); }

/// "12.34 % (0.17), 5.60 % (0.10)", or "-" if no face has such a share
std::string shares(const ordered_json& stand, const char* share) {
  std::string text;
  for (const ordered_json& faces : stand["faces"]) {
    if (!faces.contains(share)) continue;
    text += (text.empty() ? "" : ", ") + fixed_text(100 * faces[share].get<double>(), 2) + " % (" +
            fixed_text(faces["cosine"].get<double>(), 2) + ")";
  }
  return text.empty() ? "-" : text;
}

std::string stand_text(const ordered_json& stand) {
  const std::string frames = "frames " + number_text(stand["first"]) + " to " + number_text(stand["last"]);
  if (!stand.contains("first_seen")) return frames + ": never seen\n";
  return frames + ", seen from " + number_text(stand["first_seen"]) + ": faces with occupied surfels " + shares(stand, "early_covered") +
         " after " + std::to_string(scoring::ObjectTest::kEarlyFrames) + " frames, " + shares(stand, "covered") + " at the end\n";
}

std::string left_text(const ordered_json& object) {
  std::string text = "left where it was: " + number_text(object["left"]["occupied"]) + " occupied, " +
                     number_text(object["left"]["frontier"]) + " frontier";
  if (object.contains("most_left"))
    text += "; at most " + number_text(object["most_left"]["occupied"]) + " and " + number_text(object["most_left"]["frontier"]) +
            " in any frame";
  return text + "\n";
}

}  // namespace

ordered_json objects_json(const std::vector<ObjectScore>& scores) {
  ordered_json objects = ordered_json::array();
  for (const ObjectScore& score : scores) {
    ordered_json object = {{"name", score.name}, {"stands", ordered_json::array()}};
    for (const StandScore& stand : score.stands) object["stands"].push_back(stand_json(stand));
    if (score.left) object["left"] = left_json(*score.left);
    if (score.most_left) object["most_left"] = left_json(*score.most_left);
    objects.push_back(object);
  }
  return objects;
}

std::string objects_table(const ordered_json& objects) {
  std::string table;
  for (const ordered_json& object : objects) {
    std::string name = title(object["name"].get<std::string>());
    const auto add = [&](const std::string& text) {
      table += name + text;
      name = title("");
    };
    for (const ordered_json& stand : object["stands"]) add(stand_text(stand));
    if (object.contains("left")) add(left_text(object));
  }
  return table;
}

}  // namespace frontier_surfels::replay
