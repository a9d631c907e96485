#include "ros/input/warning_throttle.hpp"

#include <cctype>
#include <utility>

namespace frontier_surfels {
namespace {

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
bool is_of_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.' || c == '+' || c == '-'; }

}  // namespace

std::string kind_of(const std::string& sentence) {
  std::string kind;
  for (std::size_t i = 0; i < sentence.size();) {
    std::size_t end = i;
    while (end < sentence.size() && is_of_word(sentence[end])) ++end;
    const bool is_signed = end - i > 1 && (sentence[i] == '-' || sentence[i] == '+');
    if (end > i && is_digit(sentence[i + (is_signed ? 1 : 0)]))
      kind += '#';
    else
      kind.append(sentence, i, end - i);
    if (end < sentence.size()) kind += sentence[end];
    i = end + 1;
  }
  return kind;
}

std::size_t WarningThrottle::due(const std::string& sentence, Clock::time_point now) {
  std::string name = kind_of(sentence);
  const auto found = kinds_.find(name);
  if (found != kinds_.end()) {
    Kind& kind = found->second;
    ++kind.hidden;
    if (now - kind.told < between_) return 0;
    kind.told = now;
    return std::exchange(kind.hidden, 0);
  }
  if (kinds_.size() >= kMostKinds) {
    for (auto kind = kinds_.begin(); kind != kinds_.end();)
      kind = now - kind->second.told < between_ ? std::next(kind) : kinds_.erase(kind);
  }
  if (kinds_.size() >= kMostKinds) return 0;
  kinds_[std::move(name)].told = now;
  return 1;
}

}  // namespace frontier_surfels
