// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_sim/course.hpp"
#include "locus_sim/dice.hpp"
#include "locus_sim/roads.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// How often a robot stops at a corner, and for how long at the longest.
struct Halts {
  double share = 0.12; ///< of the corners, 0..1
  double longest_s = 3;
};

/// What a robot can do, and how it is driven.
struct Agility {
  double cruise_mps;        ///< at most
  double turn_rate_radps;   ///< in corners and on the spot
  double acceleration_mps2; ///< ordinary, mean of a change of speed
  double sudden_mps2;       ///< now and then, as a driver in a hurry does it
  double sudden_share;      ///< of all changes of speed, 0..1
  Halts halts = {};
  /// Across, in corners: these are driven as fast as that allows. 0: slowly, sharp ones on the spot.
  double cornering_mps2 = 0;
  double flicks_per_min = 0; ///< of the wrist that carries it
};

struct PlannedCourse {
  Course course;
  Start start;
};

/// Drives about a site for as long as asked: from place to place, places seen least first, with stops, turns on the
/// spot and changes of speed. Starts and ends at rest. Every roll of the dice is another course.
PlannedCourse plan_course(const Roads& roads, const Agility& agility, Duration duration, Dice& dice);

} // namespace locus::sim
