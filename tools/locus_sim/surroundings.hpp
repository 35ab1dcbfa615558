// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/imperfections.hpp"
#include "locus_sim/robot.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {

/// Puts into a world what comes and goes about a robot on its drive, and what mirrors: people, a vehicle alongside,
/// steam, wet floor, glass. The seed decides where and when; what is not asked for leaves the rest as it is.
/// False: a vehicle is asked for, and nowhere on this drive is there room for one.
bool surround(World& world, const Robot& robot, const Trajectory& trajectory, const Imperfections& imperfections,
              std::uint64_t seed);

} // namespace locus::sim
