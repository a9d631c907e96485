#include "map/change_log.hpp"

#include <algorithm>

namespace frontier_surfels {
namespace {

using Words = ChangeLog::Words;

void add(std::size_t page, ChangeLog::Word word, Words& to) {
  if (page >= to.size()) to.resize(page + 1, 0);
  to[page] |= word;
}

void add(const Words& from, Words& to) {
  if (from.size() > to.size()) to.resize(from.size(), 0);
  for (std::size_t page = 0; page < from.size(); ++page) to[page] |= from[page];
}

}  // namespace

ChangeLog::Set& ChangeLog::open(std::uint32_t frame) {
  if (sets_.empty()) {
    sets_.emplace_back();
    has_alive_ = false;
  }
  divided_ = false;
  if (frame != frame_) frames_own_.clear();
  frame_ = frame;
  sets_.back().last = frame;
  return sets_.back();
}

void ChangeLog::note(std::uint32_t frame, const std::vector<std::uint32_t>& pages, const Words& words) {
  Set& set = open(frame);
  for (std::size_t n = 0; n < pages.size(); ++n) {
    if (words[n] == 0) continue;
    add(pages[n], words[n], set.changed);
    frames_own_.emplace_back(pages[n], words[n]);
  }
}

void ChangeLog::note_all(std::uint32_t frame, std::size_t pages) {
  Set& set = open(frame);
  set.changed.assign(std::max(pages, set.changed.size()), ~Word{0});
  frames_own_.clear();
  for (std::size_t page = 0; page < pages; ++page) frames_own_.emplace_back(static_cast<std::uint32_t>(page), ~Word{0});
}

void ChangeLog::divide(const std::vector<std::uint64_t>& readers, std::uint64_t now, Words alive) {
  if (divided_) sets_.pop_back();  // nothing has come since
  while (!sets_.empty() && sets_.front().last <= readers.front()) sets_.pop_front();
  for (std::size_t n = 1; n < sets_.size();) {
    if (std::binary_search(readers.begin(), readers.end(), sets_[n].from))
      ++n;
    else
      merge(n);
  }
  while (sets_.size() >= kMostSets) {
    add(sets_[1].alive, sets_[0].alive);  // its reader is still there
    merge(1);
  }
  sets_.push_back({now, now, {}, std::move(alive)});
  divided_ = has_alive_ = true;
}

std::optional<Words> ChangeLog::alive_before() const {
  if (sets_.empty() || !has_alive_) return std::nullopt;
  return sets_.back().alive;
}

std::vector<std::uint32_t> ChangeLog::changed_pages(std::size_t pages) const {
  std::vector<std::uint32_t> changed;
  const Words& words = sets_.back().changed;
  for (std::uint32_t page = 0; page < std::min(words.size(), pages); ++page)
    if (words[page] != 0) changed.push_back(page);
  return changed;
}

/// Adds the n-th set to the one before.
void ChangeLog::merge(std::size_t n) {
  add(sets_[n].changed, sets_[n - 1].changed);
  sets_[n - 1].last = sets_[n].last;
  sets_.erase(sets_.begin() + static_cast<std::ptrdiff_t>(n));
}

ChangeLog::Difference ChangeLog::since(std::uint64_t since) const {
  Difference difference;
  // A reader of this map may know what was alive then, or, if blocks have come and gone without a new map, a little later.
  bool has_reader = false;
  for (const Set& set : sets_) {
    has_reader = has_reader || set.from == since;
    if (set.last <= since) continue;
    add(set.changed, difference.changed);
    add(set.alive, difference.known);
  }
  if (has_reader) return difference;
  if (since + 1 == frame_) {
    difference.changed.clear();
    for (const auto& [page, word] : frames_own_) add(page, word, difference.changed);
  }
  difference.known.assign(difference.changed.size(), ~Word{0});
  return difference;
}

ChangeLog::Words ChangeLog::known(std::size_t pages) const {
  Words known(pages, 0);
  for (const Set& set : sets_) add(set.alive, known);
  known.resize(pages);
  return known;
}

std::size_t ChangeLog::bytes() const {
  std::size_t sum = frames_own_.capacity() * sizeof(frames_own_[0]);
  for (const Set& set : sets_) sum += (set.changed.capacity() + set.alive.capacity()) * sizeof(Word);
  return sum;
}

}  // namespace frontier_surfels
