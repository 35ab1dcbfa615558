// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/imperfections.hpp"
#include "locus_sim/robot.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {

/// Adds moving and reflecting things to the world around a robot's drive: people, a vehicle alongside, steam, wet
/// floor, glass. The seed determines places and times; each is independent of the others. Returns false if a vehicle is
/// requested but there is no room for one anywhere on this drive.
bool surround(World& world, const Robot& robot, const Trajectory& trajectory, const Imperfections& imperfections,
              std::uint64_t seed);

} // namespace locus::sim
