/// Dense fields with one value per voxel of a grid. The references use them instead of bit fields.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/shared.h"

namespace frontier_surfels::reference {

/// field(i, j, k) for 0 <= i < size_i and so on.
template <typename T>
struct Field {
  int size_i = 0, size_j = 0, size_k = 0;
  std::vector<T> values;

  Field() = default;
  Field(int i, int j, int k, T value) : size_i(i), size_j(j), size_k(k), values(static_cast<std::size_t>(i) * j * k, value) {}
  Field(const Grid& g, T value) : Field(g.size_i, g.size_j, g.size_k, value) {}

  bool contains(int i, int j, int k) const { return i >= 0 && j >= 0 && k >= 0 && i < size_i && j < size_j && k < size_k; }
  T& operator()(int i, int j, int k) { return values[(static_cast<std::size_t>(i) * size_j + j) * size_k + k]; }
  const T& operator()(int i, int j, int k) const { return values[(static_cast<std::size_t>(i) * size_j + j) * size_k + k]; }
};

/// A decision. `open`: the exact value is so near the threshold that the device, which computes in float, may decide either way.
enum class Truth : signed char { no, yes, open };

inline Truth truth(bool value) { return value ? Truth::yes : Truth::no; }

/// Is value < limit?
inline Truth less(double value, double limit, double tolerance) {
  if (value < limit - tolerance) return Truth::yes;
  return value > limit + tolerance ? Truth::no : Truth::open;
}

inline Truth operator!(Truth a) { return a == Truth::open ? a : truth(a == Truth::no); }

inline Truth operator&&(Truth a, Truth b) {
  if (a == Truth::no || b == Truth::no) return Truth::no;
  return a == Truth::open || b == Truth::open ? Truth::open : Truth::yes;
}

inline Truth operator||(Truth a, Truth b) { return !(!a && !b); }

/// Calls visit(i, j, k) for every voxel.
template <typename SizedT, typename Visitor>
void for_each_voxel(const SizedT& sized, Visitor&& visit) {
  for (int i = 0; i < sized.size_i; ++i)
    for (int j = 0; j < sized.size_j; ++j)
      for (int k = 0; k < sized.size_k; ++k) visit(i, j, k);
}

/// Bit field in the layout of common/grid: word (j words_k + w) size_i + i, bit k % 64 of word k / 64.
template <typename T>
std::vector<std::uint64_t> pack(const Field<T>& field) {
  const std::size_t words_k = (field.size_k + 63) / 64;
  std::vector<std::uint64_t> words(field.size_i * field.size_j * words_k, 0);
  for_each_voxel(field, [&](int i, int j, int k) {
    if (field(i, j, k)) words[(j * words_k + k / 64) * field.size_i + i] |= std::uint64_t{1} << (k % 64);
  });
  return words;
}

/// The reverse of pack(). Expects no bits beyond the grid's last layer.
inline Field<char> unpack(const std::vector<std::uint64_t>& words, int size_i, int size_j, int size_k) {
  const int words_k = (size_k + 63) / 64;
  Field<char> field(size_i, size_j, size_k, 0);
  std::size_t beyond = 0;
  for (int i = 0; i < size_i; ++i)
    for (int j = 0; j < size_j; ++j)
      for (int k = 0; k < 64 * words_k; ++k) {
        const bool bit = words[(static_cast<std::size_t>(j) * words_k + k / 64) * size_i + i] >> (k % 64) & 1;
        if (k < size_k) {
          field(i, j, k) = bit;
        } else {
          beyond += bit;
        }
      }
  EXPECT_EQ(beyond, 0u) << "bits are set beyond layer " << size_k - 1;
  return field;
}

/// Counts the results of a comparison. Wrong ones fail; open ones must be few.
class Comparison {
 public:
  explicit Comparison(std::string what) : what_(std::move(what)) {}
  Comparison(const Comparison&) = delete;

  template <typename Place>
  void add(Truth expected, bool actual, const Place& place) {
    ++all_;
    if (expected == Truth::open) {
      ++open_;
    } else if ((expected == Truth::yes) != actual) {
      if (++wrong_ <= 5) ADD_FAILURE() << what_ << ": expected " << !actual << ", got " << actual << " at " << place();
    }
  }

  /// One open result is always allowed: it may happen by chance in a small comparison.
  ~Comparison() {
    EXPECT_EQ(wrong_, 0u) << what_ << ": number of wrong ones among " << all_;
    EXPECT_LE(open_, all_ / 100 + 1) << what_ << ": number of undecided ones among " << all_;
  }

 private:
  std::string what_;
  std::size_t all_ = 0, open_ = 0, wrong_ = 0;
};

inline std::string voxel_text(int i, int j, int k) {
  return "voxel (" + std::to_string(i) + ", " + std::to_string(j) + ", " + std::to_string(k) + ")";
}

inline void expect_equal(const std::string& what, const Field<Truth>& expected, const Field<char>& actual) {
  Comparison comparison(what);
  for_each_voxel(expected,
                 [&](int i, int j, int k) { comparison.add(expected(i, j, k), actual(i, j, k), [=] { return voxel_text(i, j, k); }); });
}

/// Exact equality, for stages that compute with bits and whole numbers alone.
inline void expect_equal(const std::string& what, const Field<char>& expected, const Field<char>& actual) {
  Field<Truth> truths(expected.size_i, expected.size_j, expected.size_k, Truth::no);
  for_each_voxel(expected, [&](int i, int j, int k) { truths(i, j, k) = truth(expected(i, j, k)); });
  expect_equal(what, truths, actual);
}

}  // namespace frontier_surfels::reference
