// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/plan.hpp"
#include "locus_sim/imperfections.hpp"

namespace locus::experiments {

/// Drives per seed of a harsh course: their starts are spread evenly over it, with the robot at rest or moving, and
/// each is replayed as a recording of its own.
inline constexpr int kHarshStarts = 10;
inline constexpr int kHarshDrive_s = 20;

/// Default length of a harsh course.
inline constexpr int kHarshCourse_s = 80;

/// Sensors in use.
enum class Sensors { all, lidar_and_imu, lidar };
std::string name_of(Sensors sensors);

/// A source of difficulty: a level of realism, or one group of imperfections at its harsh size in an otherwise clean
/// world.
struct Imperfection {
  std::string name;
  std::vector<std::string> options; ///< of locus-sim
  sim::Imperfections sizes;
  std::vector<std::string> courses; ///< courses to try it on; none: all
};
const std::vector<Imperfection>& imperfections();

/// A robot on a course with an imperfection: a row of the table for each choice of sensors.
struct HarshCase {
  std::string course, imperfection;
  std::vector<std::string> simulation; ///< options of locus-sim, except seed and duration
  std::vector<std::string> odometry;   ///< names of the robot's odometry sources
  double mounting_deg = 0;             ///< mounting error of the lidars relative to config.yaml
  bool bare = false;                   ///< lidar does not observe one direction

  /// Returns the choices; without odometry sources "all" would equal lidar and IMU.
  [[nodiscard]] std::vector<Sensors> sensors() const;
  /// Returns the name of the seed's course in the results.
  [[nodiscard]] std::string course_name(int seed) const;
};

/// Returns the cases whose COURSE/IMPERFECTION contains `only`; all if it is empty.
std::vector<HarshCase> harsh_cases(const std::string& only);

/// Returns these. Throws tools::Failure if `only` matches nothing.
std::vector<HarshCase> named_harsh_cases(const std::string& only);

/// Returns the course of a case, of the requested length.
Course harsh_course(const Arguments& arguments, const HarshCase& harsh_case, int seed);

/// Returns a file name: without blanks and commas.
std::string file_name(std::string name);

/// Returns the name of a run: sensors and start.
std::string harsh_configuration(Sensors sensors, int start);

/// Throws tools::Failure if `only` matches nothing, or a course is too short for its drives.
Plan plan_of_harsh(const Arguments& arguments);

} // namespace locus::experiments
