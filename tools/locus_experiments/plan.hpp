// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "locus_experiments/arguments.hpp"

namespace locus::experiments {

/// Where a robot drives.
struct Course {
  std::string name;
  std::filesystem::path folder;        ///< the capture
  std::vector<std::string> simulation; ///< options of locus-sim that make it; empty for a recording
  bool has_true_map = true;            ///< false: poses alone are compared, which takes a fourth of the time
};

/// Of a recording, seconds from its start.
struct Interval {
  int from_s, until_s;
};

/// One run of locus-replay.
struct Run {
  std::string course;
  std::string configuration;            ///< what it is called in the results
  std::vector<std::string> options;     ///< of locus-replay
  int paced_cpus = 0;                   ///< at the pace of the recording on so many processors; 0: as fast as can be
  bool loam_features = false;           ///< LOAM's points in place of the filters
  std::optional<Interval> watched = {}; ///< what happens there is measured for the table of faults
  /// A drive of the harsh table: by how much its lidars are turned against what config.yaml says. What such a drive
  /// wrote is not kept.
  std::optional<double> mounting_rad = {};
  std::string refusal = {};     ///< what locus-replay has to say instead of running; empty: it has to run
  bool shows_recording = false; ///< of the page of recordings: measured is what recording_figures() says

  [[nodiscard]] std::string id() const { return course + '/' + configuration; }
};

struct Plan {
  std::vector<Course> courses;
  std::vector<Run> runs;
};

/// A course of the output folder that locus-sim makes with these options, as long and as realistic as the user wants.
Course simulated_course(const Arguments& arguments, const std::string& name, std::vector<std::string> simulation,
                        int seed);

/// Settings of the paper's Section II and Table IV as --set options: what paper-husky.yaml says beyond husky.yaml.
const std::vector<std::string>& paper_settings();

/// The harsh courses, the faults, or their matrix, or the paper's experiments, or as much of them as a recording
/// allows.
Plan make_plan(const Arguments& arguments);

} // namespace locus::experiments
