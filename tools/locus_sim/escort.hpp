// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locus_sim/company.hpp"

namespace locus::sim {

/// A vehicle that drives alongside a robot for so many seconds of each minute, 2 to 4 m to one side, at its speed: a
/// forklift beside a slow robot, which stands beside the way until the robot is past and is left standing behind it; a
/// van beside a fast one, which comes up from far behind and goes far ahead. Only where the way is fairly straight and
/// has room beside it, so in narrow places for less time than asked, or never. Nothing: nowhere on this way.
std::optional<Passer> escort(const Scene& scene, const Way& way, double seconds_per_min, Dice& dice);

} // namespace locus::sim
