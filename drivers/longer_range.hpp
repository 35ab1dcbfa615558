// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace locus {

/// A range as a packet counts it, longer by `more` counts but within what the packet can hold: a return stays one, and
/// 0, which is none, stays none.
inline std::uint32_t longer_range(std::uint32_t counts, double more, std::uint32_t longest) {
  return counts == 0
             ? 0
             : static_cast<std::uint32_t>(std::clamp(std::round(counts + more), 1.0, static_cast<double>(longest)));
}

} // namespace locus
