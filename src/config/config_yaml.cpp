/// Config from and to YAML text. Types and names come from for_each_field, the syntax from yaml-cpp.
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "config/config_text.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

const char* type_text(bool) { return "true or false"; }
const char* type_text(int) { return "a whole number"; }
const char* type_text(double) { return "a number"; }
const char* type_text(const std::string&) { return "text"; }

/// yaml-cpp itself would read numbers in the program's locale.
bool decode(const YAML::Node& value, int& field) { return from_text(value.Scalar(), field); }
bool decode(const YAML::Node& value, double& field) { return from_text(value.Scalar(), field); }
template <typename Field>
bool decode(const YAML::Node& value, Field& field) {
  return YAML::convert<Field>::decode(value, field);
}

/// Sets the field `name`. @return a sentence that says what is wrong, or empty
std::string assign(Config& config, const std::string& name, const YAML::Node& value) {
  std::string fault = "there is no parameter '" + name + "'" + suggestion(name);
  for_each_field(config, [&](const FieldInfo& info, auto& field) {
    if (name != info.name) return;
    fault.clear();
    if (!value.IsScalar() || !decode(value, field)) {
      const std::string given = value.IsScalar() ? "'" + value.Scalar() + "'" : value.IsNull() ? "empty" : "a list or a map";
      fault = name + " is " + given + ": it must be " + type_text(field) + (*info.unit ? std::string(" [") + info.unit + "]." : ".");
    }
  });
  return fault;
}

std::string place(const std::string& path, const YAML::Mark& mark) {
  return mark.is_null() ? path : path + ":" + std::to_string(mark.line + 1);
}

YAML::Node parse_file(const std::string& path) {
  errno = 0;
  std::ifstream file(path);
  if (!file) throw FileError("The configuration " + path + " cannot be read: " + std::strerror(errno) + ".");
  if (std::filesystem::is_directory(path)) throw FileError("The configuration " + path + " is a directory: give a YAML file.");
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(file);
    if (documents.size() > 1) throw Error(path + " holds several YAML documents: keep one.");
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::Exception& e) {
    throw Error(place(path, e.mark) + ": this is not YAML: " + e.msg + ".");
  }
}

}  // namespace

Config load_config(const std::string& path) {
  const YAML::Node document = parse_file(path);
  Config config;
  if (document.IsNull()) return config;
  if (!document.IsMap()) throw Error(place(path, document.Mark()) + ": this must be a map of parameters, one 'name: value' a line.");

  std::string faults;
  std::set<std::string> seen;
  for (const auto& entry : document) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    const std::string fault = seen.insert(name).second ? assign(config, name, entry.second) : name + " is given twice: keep one.";
    if (!fault.empty()) faults += (faults.empty() ? "" : "\n") + place(path, entry.first.Mark()) + ": " + fault;
  }
  if (!faults.empty()) throw Error(faults);
  return config;
}

void set_field(Config& config, const std::string& name, const std::string& value) {
  const std::string fault = assign(config, name, YAML::Node(value));
  if (!fault.empty()) throw Error(fault);
}

std::string to_yaml(const Config& config) {
  YAML::Emitter yaml;
  yaml << YAML::BeginMap;
  for_each_field(config, [&](const FieldInfo& info, const auto& value) {
    yaml << YAML::Key << info.name << YAML::Value;
    if (std::is_same_v<std::decay_t<decltype(value)>, std::string>) yaml << YAML::DoubleQuoted;
    yaml << to_text(value);
  });
  yaml << YAML::EndMap;
  return std::string(yaml.c_str()) + "\n";
}

}  // namespace frontier_surfels
