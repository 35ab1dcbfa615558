// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "locus_experiments/harsh_plan.hpp"
#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// Fields of view of the lidars; a narrower one than a turn is made from the same packets.
inline constexpr std::array kViews_deg{360, 180, 90};

/// Names of a robot's sensors.
struct Sources {
  std::vector<std::string> lidars, odometry, imus;
};

/// Part of the sources, for one run of locus-replay.
struct Subset {
  std::string name;
  std::vector<std::string> without; ///< sources that are lost from the start
};

/// Returns all sources, lidar and IMU, lidar alone, and all but each one, as far as they differ. Odometry alone is not
/// among them: it needs no run.
std::vector<Subset> subsets_of(const Sources& sources);

/// Drive to replay with each subset and view.
struct SubsetDrive {
  std::string name;   ///< in the table
  std::string course; ///< Course::name
  int start_s = 0;    ///< the drive lasts from here to the end of the course
  Sources sources;
  std::vector<std::string> unsound; ///< motion sources whose errors exceed those of real robots
  double mounting_rad = 0;          ///< as in Run
};

/// Returns the motion sources with an imperfection of their own larger than in a real world. Lidars always count as
/// sound.
std::vector<std::string> unsound_sources(const HarshCase& harsh_case);

/// Returns the start times of `count` drives, evenly spread over the first half of a course.
std::vector<int> starts_of(int duration_s, int count);

/// Run with its place in the table.
struct SubsetRun {
  Run run;
  std::string drive;
  int view_deg;
  std::string subset;
  bool is_sound;                    ///< all sources of the subset are
  std::vector<std::string> unsound; ///< those of the drive
};

/// Plans the runs of a drive, the one with all sources first for each view.
std::vector<SubsetRun> subset_runs(const SubsetDrive& drive);

/// Simulated harsh courses, as far as the user wants, and their drives.
struct SubsetCourses {
  std::vector<Course> courses;
  std::vector<SubsetDrive> drives;
};
SubsetCourses simulated_subsets(const Arguments& arguments);

} // namespace locus::experiments
