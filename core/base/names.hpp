// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace locus {

/// Enumeration whose values count from zero, with an array of their names in that order, names_of(E), beside it. Users
/// read and write these names.
template <class E>
concept Named = requires(E value) {
  names_of(value)[0];
};

template <Named E> constexpr std::string_view to_string(E value) {
  return names_of(value)[static_cast<std::size_t>(value)];
}

/// Returns the value of that name, or nothing if there is none.
template <Named E> constexpr std::optional<E> from_string(std::string_view name) {
  const auto names = names_of(E{});
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name)
      return static_cast<E>(i);
  }
  return std::nullopt;
}

} // namespace locus
