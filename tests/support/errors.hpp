// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "core/base/expected.hpp"

namespace locus {

/// Returns the error of an outcome, empty for a success.
template <class T> std::string error_of(const Expected<T, std::string>& outcome) {
  return outcome ? "" : outcome.error();
}

inline bool contains(std::string_view text, std::string_view part) { return text.find(part) != std::string_view::npos; }

} // namespace locus
