// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// What moving things look like, around an origin on the ground, facing along x.

/// Two legs, a trunk and a head, as someone stands; seen from all sides the same.
std::vector<Surface> standing_person();

/// The same with arms, and legs and arms swung forward (one of each) and back by up to `swing_rad`.
std::vector<Surface> walking_person(double swing_rad);

/// Turned to the left by `yaw_rad`.
std::vector<Surface> forklift(double yaw_rad);

std::vector<Surface> car();
std::vector<Surface> van();

} // namespace locus::sim
