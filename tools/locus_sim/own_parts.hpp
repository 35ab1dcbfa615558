// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locus_sim/dice.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Parts of a robot visible to its own lidars, base frame.
struct OwnParts {
  std::vector<Surface> surfaces;
  std::optional<Bounds> body_box; ///< contains every second part, from the first on, with a margin, and no other
};

/// Places masts, arms, rails and cables half a metre or more from a lidar, in its view. Half of them are behind it,
/// inside the body box; the others are ahead to the left and right and missing from the box, as by an oversight.
OwnParts own_parts(int count, const Eigen::Vector3d& lidar_m, Dice& dice);

} // namespace locus::sim
