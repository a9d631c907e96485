/// Reads the parameters of a node into the fields of a struct.
#pragma once

#include <XmlRpcValue.h>

#include <map>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

using Parameters = std::map<std::string, XmlRpc::XmlRpcValue>;

/// The parameters of a namespace, by their names in it. Namespaces within it are left out.
Parameters list_parameters(const std::string& name_space);

/// Sets a field from a parameter. @return null, or a description of what the parameter must be
const char* assign(XmlRpc::XmlRpcValue& value, bool& field);
const char* assign(XmlRpc::XmlRpcValue& value, int& field);
const char* assign(XmlRpc::XmlRpcValue& value, double& field);
const char* assign(XmlRpc::XmlRpcValue& value, std::string& field);

std::string shown(const XmlRpc::XmlRpcValue& value);

/// A visitor like that of for_each_field: sets the fields that have a parameter, and removes those parameters from the list.
class ParameterReader {
 public:
  /// @param faults  gets a line for each parameter of a wrong type
  ParameterReader(Parameters& parameters, std::string& faults) : parameters_(parameters), faults_(faults) {}

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
  Parameters& parameters_;
  std::string& faults_;
};

/// A visitor that adds a sentence for each number that is out of its range.
class RangeCheck {
 public:
  explicit RangeCheck(std::vector<std::string>& faults) : faults_(faults) {}

  template <typename Value>
  void operator()(const FieldInfo& info, const Value& value) const {
    if constexpr (std::is_arithmetic_v<Value>) {
      if (std::is_same_v<Value, bool> || (value >= info.lowest && value <= info.highest)) return;
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text << info.name << " is " << value << " " << info.unit << ": it must be from " << info.lowest << " to " << info.highest << " "
           << info.unit << ".";
      faults_.push_back(text.str());
    }
  }

 private:
  std::vector<std::string>& faults_;
};

/// @param faults  lines. @throws Error with all of them, if there are any
void throw_if_any(std::string faults);

}  // namespace frontier_surfels
