// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace locus {

/// An enumeration whose values count from zero and which has a names_of(E) beside it: an array of the names of its
/// values, in their order. These are the words that users read and write.
template <class E>
concept Named = requires(E value) {
  names_of(value)[0];
};

template <Named E> constexpr std::string_view to_string(E value) {
  return names_of(value)[static_cast<std::size_t>(value)];
}

/// The value of that name; nothing where there is none.
template <Named E> constexpr std::optional<E> from_string(std::string_view name) {
  const auto names = names_of(E{});
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name)
      return static_cast<E>(i);
  }
  return std::nullopt;
}

} // namespace locus
