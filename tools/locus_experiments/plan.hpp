// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "locus_experiments/arguments.hpp"

namespace locus::experiments {

/// Course of a robot: a capture, recorded or simulated.
struct Course {
  std::string name;
  std::filesystem::path folder;        ///< of the capture
  std::vector<std::string> simulation; ///< options of locus-sim that create it; empty for a recording
  bool has_true_map = true;            ///< false: only poses are compared, in a quarter of the time
};

/// Interval of a recording, seconds from its start.
struct Interval {
  int from_s, until_s;
};

/// One run of locus-replay.
struct Run {
  std::string course;
  std::string configuration;        ///< name in the results
  std::vector<std::string> options; ///< for locus-replay
  int paced_cpus = 0;               ///< at the pace of the recording on this many processors; 0: as fast as possible
  bool loam_features = false;       ///< LOAM's points instead of the filters
  std::optional<Interval> watched = {}; ///< interval measured for the table of faults
  /// Mounting error of the lidars relative to config.yaml, for a drive of the harsh table or of that of subsets. The
  /// files of such a drive are deleted.
  std::optional<double> mounting_rad = {};
  std::string refusal = {};     ///< expected refusal by locus-replay; empty: it has to run
  bool shows_recording = false; ///< for the page of recordings: measures recording_figures()
  bool shows_subset = false;    ///< for the table of subsets: measures subset_figures()

  [[nodiscard]] std::string id() const { return course + '/' + configuration; }
};

struct Plan {
  std::vector<Course> courses;
  std::vector<Run> runs;
};

/// Returns a course that locus-sim creates in the output folder, with these options and the user's duration and
/// realism.
Course simulated_course(const Arguments& arguments, const std::string& name, std::vector<std::string> simulation,
                        int seed);

/// Returns the settings of the paper's Section II and Table IV as --set options: those of paper-husky.yaml that are not
/// in husky.yaml.
const std::vector<std::string>& paper_settings();

/// Plans the harsh courses, the faults, their matrix, or the paper's experiments, the latter as far as a recording
/// allows.
Plan make_plan(const Arguments& arguments);

} // namespace locus::experiments
