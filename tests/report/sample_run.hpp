// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "locus_replay/report.hpp"

namespace locus::test {

/// A run that nobody drove: rounds through a town on a grid of streets, with a lidar and a source that fail on the way.
struct SampleRun {
  /// At ten sweeps a second, with truth at a hundred poses a second. From ten minutes on the town has more surfaces
  /// than the page may show.
  static SampleRun of(std::chrono::seconds length, const std::string& capture);
  /// A moment without truth, map or motion sources.
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
