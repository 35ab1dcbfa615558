// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
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
  std::size_t place = 0;                ///< among all runs of the plan, whichever shard does them
  std::optional<Interval> watched = {}; ///< what happens there is measured for the table of faults
  /// A drive of the harsh table: by how much its lidars are turned against what config.yaml says. What such a drive
  /// wrote is not kept.
  std::optional<double> mounting_rad = {};
  std::string refusal = {}; ///< what locus-replay has to say instead of running; empty: it has to run

  [[nodiscard]] std::string id() const { return course + '/' + configuration; }
};

/// Options of locus-sim that every simulated course of an experiment shares: how realistic the world is.
std::vector<std::string> realism_of(const Arguments& arguments);

struct Plan {
  std::vector<Course> courses;
  std::vector<Run> runs;
  std::size_t size = 0; ///< runs of all shards
};

/// Settings of the paper's Section II and Table IV as --set options: what paper-husky.yaml says beyond husky.yaml.
const std::vector<std::string>& paper_settings();

/// The harsh courses, the faults, or their matrix, or the paper's experiments, or as much of them as a recording
/// allows; of these the part of one shard: of faults and harsh courses every N-th course with all its runs, else every
/// N-th run with the courses that they need.
Plan make_plan(const Arguments& arguments);

} // namespace locus::experiments
