// SPDX-License-Identifier: Apache-2.0
#include "config/nearest_word.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace locus {
namespace {

/// Edits (a letter more, less or other) that make b of a.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1); // row[j]: from the part of a seen so far to the first j letters of b
  std::iota(row.begin(), row.end(), 0);
  for (const char c : a) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (c == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

} // namespace

std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known) {
  const auto distance = [&](std::string_view candidate) {
    return std::pair{edit_distance(word, candidate.substr(0, word.size())), edit_distance(word, candidate)};
  };
  return *std::min_element(known.begin(), known.end(),
                           [&](std::string_view a, std::string_view b) { return distance(a) < distance(b); });
}

} // namespace locus
