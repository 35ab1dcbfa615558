// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/imperfections.hpp"
#include "locus_sim/robot.hpp"

namespace locus::sim {

/// Returns the robot with the imperfections of its mounting, time, lidars and motion sources. The seed determines
/// directions, signs and times for each imperfection independently. Without any, the result is bit-identical to the
/// input.
Robot impaired(Robot robot, const Imperfections& imperfections, std::uint64_t seed);

} // namespace locus::sim
