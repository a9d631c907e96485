#include "ros/input/parameter_reader.hpp"

#include <ros/param.h>

#include <locale>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

using XmlRpc::XmlRpcValue;

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

Parameters list_parameters(const std::string& name_space) {
  Parameters parameters;
  XmlRpcValue all;
  if (!ros::param::get(name_space, all) || all.getType() != XmlRpcValue::TypeStruct) return parameters;
  for (auto& [name, value] : all) {
    if (value.getType() != XmlRpcValue::TypeStruct) parameters[name] = value;
  }
  return parameters;
}

void throw_if_any(std::string faults) {
  if (faults.empty()) return;
  faults.pop_back();  // the last end of line
  throw Error(faults);
}

}  // namespace frontier_surfels
