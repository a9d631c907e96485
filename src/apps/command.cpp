#include "apps/command.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "config/config_text.hpp"

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

/// @param wanted  what the text must be. @param fits  whether a text is that
template <typename Fits>
CLI::Validator checked(const std::string& wanted, Fits fits) {
  const auto check = [wanted, fits](const std::string& text) {
    return fits(text) ? std::string() : "must be " + wanted + ", not '" + text + "'.";
  };
  return CLI::Validator(check, "");
}

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t n = 0; n < words.size(); ++n) text += (n == 0 ? "" : n + 1 < words.size() ? ", " : " or ") + words[n];
  return text;
}

}  // namespace

CLI::Validator not_empty() {
  return CLI::Validator([](const std::string& text) { return text.empty() ? "must not be empty." : std::string(); }, "");
}

CLI::Validator whole_number(int least, int most) {
  return checked("a whole number from " + to_text(least) + " to " + to_text(most), [least, most](const std::string& text) {
    int value = 0;
    return from_text(text, value) && value >= least && value <= most;
  });
}

CLI::Validator positive_number() {
  return checked("a number above 0", [](const std::string& text) {
    double value = 0;
    return from_text(text, value) && std::isfinite(value) && value > 0;
  });
}

CLI::Validator number(double least, double most) {
  return checked("a number from " + to_text(least) + " to " + to_text(most), [least, most](const std::string& text) {
    double value = 0;
    return from_text(text, value) && value >= least && value <= most;
  });
}

CLI::Validator one_of(const std::vector<std::string>& words) {
  return checked(listed(words), [words](const std::string& text) { return std::find(words.begin(), words.end(), text) != words.end(); });
}

CLI::ValidationError wrong_usage(std::string sentences) {
  while (!sentences.empty() && sentences.back() == '\n') sentences.pop_back();
  return CLI::ValidationError(sentences, CLI::ExitCodes::ValidationError);
}

std::string sentence_of(const CLI::ParseError& error) {
  const std::string text = error.what(), name = text.substr(0, text.find(':'));
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) == nullptr || name == text) return text;
  if (text.find("At Most") != std::string::npos) return name + " can be given only once.";
  return name + " needs a value.";
}

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
