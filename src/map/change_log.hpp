/// Which slots of the map frames have changed, for readers that follow the map.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

namespace frontier_surfels {

/// All is kept in words of 64 bits, a word for each page, a bit for each slot. There is one set of them for all frames between two readers,
/// who ask for what has changed since they asked last: 16 bytes a page and reader.
class ChangeLog {
 public:
  using Word = std::uint64_t;
  using Words = std::vector<Word>;

  /// Frame `frame` has changed these slots. Frames come in order, also those that have changed nothing; one may come several times.
  /// @param words  one for each page; there may be more behind them
  void note(std::uint32_t frame, const std::vector<std::uint32_t>& pages, const Words& words);

  /// Frame `frame` has changed all slots of the pages 0, 1, ... `pages` - 1.
  void note_all(std::uint32_t frame, std::size_t pages);

  /// A reader has been told of the map as it is now. What no reader asks for any more is forgotten.
  /// @param readers  the maps that readers have, ascending; at least one. @param now  number of this map. @param alive  its slots
  void divide(const std::vector<std::uint64_t>& readers, std::uint64_t now, Words alive);

  /// @name For divide(), if the whole of `alive` is not at hand
  /// @{
  /// `alive` as the last divide() got it; null if there was none
  std::optional<Words> alive_before() const;
  /// The pages 0, 1, ... `pages` - 1 that have changed since then.
  std::vector<std::uint32_t> changed_pages(std::size_t pages) const;
  /// @}

  void clear() { *this = {}; }

  struct Difference {
    Words changed;  ///< slots that have changed; pages behind the last word have not
    Words known;    ///< slots of surfels that the reader may know; none behind the last word
  };

  /// What has changed after the map `since`. Exact for its reader, unless there are too many readers, and for the last frame. Else, changes
  /// of earlier frames are contained as well, and all slots may be known.
  Difference since(std::uint64_t since) const;

  /// Slots of the pages 0, 1, ... `pages` - 1 whose surfels some reader may know.
  Words known(std::size_t pages) const;

  std::size_t bytes() const;

 private:
  static constexpr std::size_t kMostSets = 8;

  struct Set {
    std::uint64_t from = 0, last = 0;  ///< the map that a reader has been told of, and the last frame in this set
    Words changed;
    Words alive;  ///< in the map `from`
  };

  Set& open(std::uint32_t frame);
  void merge(std::size_t n);

  std::deque<Set> sets_;
  bool divided_ = false;                                    ///< the last set is for frames that come
  bool has_alive_ = false;                                  ///< divide() has made the last set
  std::uint64_t frame_ = 0;                                 ///< the last one
  std::vector<std::pair<std::uint32_t, Word>> frames_own_;  ///< what it has changed: pages with their words
};

}  // namespace frontier_surfels
