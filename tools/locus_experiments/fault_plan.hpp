// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// Criterion for a run.
enum class Demand : std::uint8_t {
  accurate,            ///< mean error at most `limit` metres
  accurate_and_honest, ///< the same, and no position error above three standard deviations
  unharmed,            ///< mean error at most by the share `limit` larger than without the fault, plus a centimetre
  unharmed_or_flagged, ///< the same; or sweeps are flagged, and no position error is above three standard deviations
  carried,             ///< error added during the fault at most `limit` times that of the motion source alone
  resisted,            ///< error added during the fault, and to the mean error, at most `limit` metres
  no_worse_than_wheels ///< mean error at most that of the wheels; variance grows tenfold along the path, not across
};

/// Duration of a fault: from half time on, unless it is permanent.
enum class Lasting : std::uint8_t { always, second_half, ten_seconds, five_seconds };

/// Course on which the wheels spin at half time.
inline const std::string kSlipCourse = "slip";

/// Row of the table: a robot, its fault, and the criterion.
struct FaultCase {
  std::string configuration;       ///< run name
  std::string what;                ///< description
  std::string course;              ///< kind of course
  std::vector<std::string> faults; ///< SENSOR:KIND[=VALUE], as for --fail of locus-replay
  Lasting lasting = Lasting::always;
  Demand demand = Demand::accurate;
  double limit = 0;
  int silent_sweeps = 0; ///< sweeps per seed for which the fault leaves no packet: these may fail

  /// Returns the sensors with a fault, each once.
  [[nodiscard]] std::vector<std::string> faulty() const;
  /// Returns the course without fault: the same, except for a slip, which is part of the course.
  [[nodiscard]] std::string reference_course() const { return course == kSlipCourse ? "urban" : course; }
};

/// Configuration of the fault-free run, the reference for others on the same course.
inline const std::string kNoFault = "none";

const std::vector<FaultCase>& fault_cases();

/// Describes FaultCase::course in words.
std::string describe_course(const std::string& kind);

/// Returns a course of this kind, of the requested length.
Course course_of_kind(const Arguments& arguments, const std::string& kind, int seed);

/// Returns the name of a course: one kind, one seed.
std::string fault_course(const std::string& kind, int seed);

/// Returns the most accurate motion source on such a course.
std::string best_motion_source(const std::string& kind);

/// Returns the course name of the seeded runs that test the covariances, index 0..N-1.
std::string honesty_course(int index);

/// Plans each case on each seed, then the runs that test the covariances.
Plan plan_of_faults(const Arguments& arguments);

} // namespace locus::experiments
