// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace locus {

/// Returns whether a direction lies within a field of view centred on azimuth 0.
inline bool is_in_view(double azimuth_deg, double view_deg) {
  return std::abs(std::remainder(azimuth_deg, 360.0)) <= 0.5 * view_deg;
}

} // namespace locus
