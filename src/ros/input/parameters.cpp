#include "ros/input/parameters.hpp"

#include <ros/names.h>
#include <ros/param.h>

#include <set>
#include <sstream>
#include <type_traits>

#include "frontier_surfels/types.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels {
namespace {

using XmlRpc::XmlRpcValue;

/// Sets a field from a parameter. @return null, or a description of what the parameter must be
const char* assign(XmlRpcValue& value, bool& field) {
  if (value.getType() != XmlRpcValue::TypeBoolean) return "true or false";
  field = static_cast<bool>(value);
  return nullptr;
}

const char* assign(XmlRpcValue& value, int& field) {
  if (value.getType() != XmlRpcValue::TypeInt) return "a whole number";
  field = static_cast<int>(value);
  return nullptr;
}

const char* assign(XmlRpcValue& value, double& field) {
  const auto type = value.getType();
  if (type != XmlRpcValue::TypeDouble && type != XmlRpcValue::TypeInt) return "a number";
  field = type == XmlRpcValue::TypeInt ? static_cast<int>(value) : static_cast<double>(value);
  return nullptr;
}

const char* assign(XmlRpcValue& value, std::string& field) {
  if (value.getType() != XmlRpcValue::TypeString) return "text";
  field = static_cast<std::string>(value);
  return nullptr;
}

std::string shown(const XmlRpcValue& value) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << value;
  return text.str();
}

/// The parameters of a namespace, by their names in it. Namespaces within it are left out.
std::map<std::string, XmlRpcValue> list_parameters(const std::string& name_space) {
  std::map<std::string, XmlRpcValue> parameters;
  XmlRpcValue all;
  if (!ros::param::get(name_space, all) || all.getType() != XmlRpcValue::TypeStruct) return parameters;
  for (auto& [name, value] : all) {
    if (value.getType() != XmlRpcValue::TypeStruct) parameters[name] = value;
  }
  return parameters;
}

/// A visitor for for_each_field: sets the fields that have a parameter, and removes those parameters from the list.
class Reader {
 public:
  Reader(std::map<std::string, XmlRpcValue>& parameters, std::string& faults) : parameters_(parameters), faults_(faults) {}

  template <typename Field>
  void operator()(const FieldInfo& info, Field& field) {
    const auto entry = parameters_.find(info.name);
    if (entry == parameters_.end()) return;
    if (const char* wanted = assign(entry->second, field)) {
      faults_ += "~" + std::string(info.name) + " is " + shown(entry->second) + ": it must be " + wanted +
                 (*info.unit ? std::string(" [") + info.unit + "].\n" : ".\n");
    }
    parameters_.erase(entry);
  }

 private:
  std::map<std::string, XmlRpcValue>& parameters_;
  std::string& faults_;
};

void throw_if_any(std::string faults) {
  if (faults.empty()) return;
  faults.pop_back();  // the last end of line
  throw Error(faults);
}

}  // namespace

std::vector<std::string> NodeConfig::problems() const {
  std::vector<std::string> faults = mapper.problems();
  for_each_node_field(*this, [&](const FieldInfo& info, const auto& value) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>) {
      if (std::is_same_v<std::decay_t<decltype(value)>, bool> || (value >= info.lowest && value <= info.highest)) return;
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text << info.name << " is " << value << " " << info.unit << ": it must be from " << info.lowest << " to " << info.highest << " "
           << info.unit << ".";
      faults.push_back(text.str());
    }
  });
  if (messages::strip_slash(world_frame).empty())
    faults.push_back("world_frame is empty: it must be the tf frame in which the map does not move.");
  if (!(projected_min_z < projected_max_z))
    faults.push_back("projected_min_z is not below projected_max_z: ~projected_map shows the heights between them.");
  if (on_time_jump != "keep" && on_time_jump != "reset")
    faults.push_back("on_time_jump is '" + on_time_jump + "': it must be keep or reset.");
  if (use_color && color_transport == "compressedDepth")
    faults.push_back("color_transport is compressedDepth, which is for depth images: choose raw or compressed.");
  if (cloud_confidence != "frontier" && cloud_confidence != "occupied")
    faults.push_back("cloud_confidence is '" + cloud_confidence + "': it must be frontier or occupied.");
  return faults;
}

NodeConfig read_parameters(const ros::NodeHandle& pnh, std::vector<std::string>* warnings) {
  NodeConfig config;
  std::string faults;
  auto parameters = list_parameters(pnh.getNamespace());
  for_each_field(config.mapper, Reader(parameters, faults));
  for_each_node_field(config, Reader(parameters, faults));
  for (const std::string& problem : config.problems()) faults += problem + "\n";
  throw_if_any(faults);
  config.world_frame = messages::strip_slash(config.world_frame);

  std::vector<std::string> names;
  for_each_node_field(config, [&](const FieldInfo& info, const auto&) { names.emplace_back(info.name); });
  for (const auto& entry : parameters) {
    if (warnings != nullptr) warnings->push_back("There is no parameter ~" + entry.first + suggestion(entry.first, names));
  }
  return config;
}

void write_parameters(const ros::NodeHandle& pnh, const NodeConfig& config) {
  const auto write = [&pnh](const FieldInfo& info, const auto& value) { pnh.setParam(info.name, value); };
  for_each_field(config.mapper, write);
  for_each_node_field(config, write);
}

Config read_mapper_config(const std::string& node) {
  Config config;
  std::string faults;
  auto parameters = list_parameters(ros::names::resolve(node));
  for_each_field(config, Reader(parameters, faults));
  for (const std::string& problem : config.problems()) faults += problem + "\n";
  throw_if_any(faults);
  return config;
}

}  // namespace frontier_surfels
