// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Shapes of moving things, around an origin on the ground, facing along x.

/// Returns a standing person: two legs, a trunk and a head, rotationally symmetric.
std::vector<Surface> standing_person();

/// Returns a person with arms; legs and arms swing forward (one of each) and back by up to `swing_rad`.
std::vector<Surface> walking_person(double swing_rad);

/// Returns a forklift turned to the left by `yaw_rad`.
std::vector<Surface> forklift(double yaw_rad);

std::vector<Surface> car();
std::vector<Surface> van();

} // namespace locus::sim
