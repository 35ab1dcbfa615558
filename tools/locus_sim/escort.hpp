// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locus_sim/company.hpp"

namespace locus::sim {

/// Simulates a vehicle that drives alongside a robot for `seconds_per_min`, 2 to 4 m to one side, at its speed: a
/// forklift for a slow robot, which waits beside the path until the robot has passed and stops behind it; a van for a
/// fast one, which approaches from far behind and leaves far ahead. Needs a fairly straight path with room beside it,
/// so that in narrow places it drives for less time than requested, or never. Returns nothing if there is no room
/// anywhere.
std::optional<Passer> escort(const Scene& scene, const Way& way, double seconds_per_min, Dice& dice);

} // namespace locus::sim
