// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_sim/course.hpp"
#include "locus_sim/dice.hpp"
#include "locus_sim/roads.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Frequency of stops at corners, and their longest duration.
struct Halts {
  double share = 0.12; ///< of the corners, 0..1
  double longest_s = 3;
};

/// Dynamics of a robot and style of its driver.
struct Agility {
  double cruise_mps;        ///< at most
  double turn_rate_radps;   ///< in corners and on the spot
  double acceleration_mps2; ///< usual mean of a change of speed
  double sudden_mps2;       ///< occasional, as by a driver in a hurry
  double sudden_share;      ///< of all changes of speed, 0..1
  Halts halts = {};
  /// Lateral acceleration limit in corners, which determines their speed. 0: slow corners, sharp ones on the spot.
  double cornering_mps2 = 0;
  double flicks_per_min = 0; ///< of the wrist that carries the lidar
};

struct PlannedCourse {
  Course course;
  Start start;
};

/// Plans a drive about a site for `duration`: from place to place, least visited lanes first, with stops, turns on the
/// spot and changes of speed. Starts and ends at rest. Each state of `dice` gives another course.
PlannedCourse plan_course(const Roads& roads, const Agility& agility, Duration duration, Dice& dice);

} // namespace locus::sim
