// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// What is asked of a run.
enum class Demand : std::uint8_t {
  accurate,            ///< mean error at most `limit` metres
  accurate_and_honest, ///< that, and no position farther off than three of its standard deviations
  unharmed,            ///< mean error at most the share `limit` larger than without the fault; a centimetre is allowed
  unharmed_or_told,    ///< that; or sweeps are flagged, and no position is farther off than three standard deviations
  carried,             ///< error added while the fault lasts at most `limit` times that of the motion source alone
  resisted,            ///< error added while the fault lasts, and to the mean error, at most `limit` metres
  no_worse_than_wheels ///< mean error at most that of the wheels; variance grows ten times along the way, not across
};

/// How long a fault lasts: from half time on, unless it is there from the start.
enum class Lasting : std::uint8_t { always, second_half, ten_seconds, five_seconds };

/// A kind of course on which the wheels spin at half time.
inline const std::string kSlipCourse = "slip";

/// A row of the table: what happens to which robot, and what is asked of it.
struct FaultCase {
  std::string configuration;       ///< name of the run
  std::string what;                ///< in words
  std::string course;              ///< key of a kind of course
  std::vector<std::string> faults; ///< SENSOR:KIND[=VALUE] as --fail of locus-replay has them
  Lasting lasting = Lasting::always;
  Demand demand = Demand::accurate;
  double limit = 0;
  int silent_sweeps = 0; ///< for which the fault leaves no packet, on each seed: those may fail

  /// The sensors that have a fault, each once.
  [[nodiscard]] std::vector<std::string> faulty() const;
  /// Where the robot drives when all is well: the same but for a slip, which is in the course.
  [[nodiscard]] std::string reference_course() const { return course == kSlipCourse ? "urban" : course; }
};

/// The run of a case that others on the same course are compared with.
inline const std::string kNoFault = "none";

const std::vector<FaultCase>& fault_cases();

/// In words, of FaultCase::course.
std::string describe_course(const std::string& kind);

/// A course of this kind, of the length that is asked for.
Course course_of_kind(const Arguments& arguments, const std::string& kind, int seed);

/// Name of a course: one kind, one seed.
std::string fault_course(const std::string& kind, int seed);

/// The motion source that knows the way best on such a course.
std::string best_motion_source(const std::string& kind);

/// The seeded runs by which the covariances are judged: their course's name, 0..N-1.
std::string honesty_course(int index);

/// Each case on each seed, then the runs for the covariances.
Plan plan_of_faults(const Arguments& arguments);

} // namespace locus::experiments
