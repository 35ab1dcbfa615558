// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locus_sim/dice.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Parts of a robot that its own lidars see, in the base frame.
struct OwnParts {
  std::vector<Surface> surfaces;
  std::optional<Bounds> body_box; ///< holds every other one, from the first, with some room about them, and no other
};

/// Masts, arms, rails and cables half a metre and more from a lidar, where it sees them. The one half stands behind it
/// and is what the box of the body is for; the other is to the left and right ahead, and nobody has thought of it.
OwnParts own_parts(int count, const Eigen::Vector3d& lidar_m, Dice& dice);

} // namespace locus::sim
