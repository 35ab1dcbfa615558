// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace locus {

/// Lengthens a raw range by `more` counts, clamped to [1, longest] so that a return remains a return. Leaves 0 (no
/// return) unchanged.
inline std::uint32_t longer_range(std::uint32_t counts, double more, std::uint32_t longest) {
  return counts == 0
             ? 0
             : static_cast<std::uint32_t>(std::clamp(std::round(counts + more), 1.0, static_cast<double>(longest)));
}

} // namespace locus
