// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "locus_replay/report.hpp"

namespace locus::test {

/// A made-up run: laps through a town on a grid of streets, with temporary failures of a lidar and a source.
struct SampleRun {
  /// Ten sweeps per second, true poses at 100 Hz. From ten minutes on the town has more surfaces than the page may
  /// show.
  static SampleRun of(std::chrono::seconds length, const std::string& capture);
  /// A short run without truth, map or motion sources.
  static SampleRun bare();

  [[nodiscard]] tools::Report report() const {
    return {summary, config, capture_start, path_m, sweeps, map, truth, accuracy};
  }

  nlohmann::ordered_json summary;
  Config config;
  Stamp capture_start;
  double path_m = 0;
  std::vector<tools::SweepRecord> sweeps;
  std::vector<SurfacePoint> map;
  std::vector<StampedPose> truth;
  std::optional<TrajectoryAccuracy> accuracy;
};

} // namespace locus::test
