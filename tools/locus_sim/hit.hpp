// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Intersection of a ray with the scene.
struct Hit {
  Eigen::Vector3d point_m;
  double range_m;
  double cos_incidence; ///< angle between ray and normal, 0..1
  std::uint8_t reflectivity;
  const Surface* surface; ///< nullptr: a moving one
  Eigen::Vector3d normal; ///< of either sign
  bool apparent = false;  ///< no physical surface: steam, or a mirror image
};

} // namespace locus::sim
