// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locus_sim/imperfections.hpp"
#include "locus_sim/robot.hpp"

namespace locus::sim {

/// The same robot with the imperfections of its mounting, time, lidars and motion sources. The seed decides directions,
/// signs and moments, each imperfection by itself: what one does, does not depend on the others. Without any it is the
/// same robot, to the bit.
Robot impaired(Robot robot, const Imperfections& imperfections, std::uint64_t seed);

} // namespace locus::sim
