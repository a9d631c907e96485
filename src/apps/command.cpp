#include "apps/command.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace frontier_surfels::replay {
namespace {

/// Number of letters to insert, remove or replace that turn one word into the other (Levenshtein distance).
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({replaced, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

/// The long name of an option that is most like this one; empty if none is.
std::string nearest(const CLI::App& app, const std::string& name) {
  std::string best;
  std::size_t best_distance = name.size() / 2 + 1;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& known : option->get_lnames()) {
      const std::size_t letters = distance(name, known);
      if (letters >= best_distance || option->get_group().empty()) continue;
      best = known;
      best_distance = letters;
    }
  }
  return best;
}

}  // namespace

void check_option_names(const CLI::App& app, const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument == "--") return;
    if (argument.compare(0, 2, "--") != 0) continue;
    const std::string name = argument.substr(2, argument.find('=') - 2);
    if (app.get_option_no_throw("--" + name) != nullptr) continue;
    const std::string known = nearest(app, name);
    throw CLI::ExtrasError("There is no option --" + name + (known.empty() ? "." : "; did you mean --" + known + "?"),
                           CLI::ExitCodes::ExtrasError);
  }
}

}  // namespace frontier_surfels::replay
