// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/plan.hpp"
#include "locus_sim/imperfections.hpp"

namespace locus::experiments {

/// Drives of a seed of a harsh course: they begin at places spread evenly over it, where the robot stands or moves as
/// it happens, and are replayed each as a recording of its own.
inline constexpr int kHarshStarts = 10;
inline constexpr int kHarshDrive_s = 20;

/// How long a harsh course lasts unless the user says otherwise.
inline constexpr int kHarshCourse_s = 80;

/// Which sensors there are.
enum class Sensors { all, lidar_and_imu, lidar };
std::string name_of(Sensors sensors);

/// What makes a course hard: a level of realism, or one group of imperfections in hard use in an otherwise clean world.
struct Imperfection {
  std::string name;
  std::vector<std::string> options; ///< of locus-sim
  sim::Imperfections sizes;
  std::vector<std::string> courses; ///< on which it is tried; none: on all
};
const std::vector<Imperfection>& imperfections();

/// A robot in a place with a imperfection: a row of the table for each choice of sensors.
struct HarshCase {
  std::string course, imperfection;
  std::vector<std::string> simulation; ///< options of locus-sim, but for seed and duration
  std::vector<std::string> odometry;   ///< names of the robot's odometry sources
  double mounting_deg = 0;             ///< by which its lidars are turned against what config.yaml says
  bool bare = false;                   ///< lidar tells nothing of one direction

  /// Without odometry sources all sensors are lidar and IMU.
  [[nodiscard]] std::vector<Sensors> sensors() const;
  /// Of the seed's course, in the results.
  [[nodiscard]] std::string course_name(int seed) const;
};

/// The cases whose COURSE/IMPERFECTION holds `only`; all if it is empty.
std::vector<HarshCase> harsh_cases(const std::string& only);

/// Of a run: which sensors, which start.
std::string harsh_configuration(Sensors sensors, int start);

/// Throws tools::Failure where `only` names nothing, or a course is too short for its drives.
Plan plan_of_harsh(const Arguments& arguments);

} // namespace locus::experiments
