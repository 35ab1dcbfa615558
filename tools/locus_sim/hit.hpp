// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// What a ray meets.
struct Hit {
  Eigen::Vector3d point_m;
  double range_m;
  double cos_incidence; ///< of the angle between ray and normal, 0..1
  std::uint8_t reflectivity;
  const Surface* surface; ///< nothing: it moves
  Eigen::Vector3d normal; ///< to either side
  bool apparent = false;  ///< no surface is there: steam, or what a mirror shows
};

} // namespace locus::sim
