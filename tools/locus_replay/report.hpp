// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include <nlohmann/json.hpp>

#include "accuracy/trajectory_accuracy.hpp"
#include "config/config.hpp"
#include "core/map/surface_map.hpp"
#include "drivers/files/motion_files.hpp"
#include "locus_replay/sweep_record.hpp"

namespace locus::tools {

/// Contents of report.html. Empty parts are left out of the page.
struct Report {
  const nlohmann::ordered_json& summary; ///< as in summary.json
  const Config& config;
  Stamp capture_start; ///< origin of the displayed times
  double path_m;       ///< length of the path
  std::span<const SweepRecord> sweeps;
  std::span<const SurfacePoint> map;                 ///< odom frame; see visible_surfaces()
  std::span<const StampedPose> truth;                ///< in its own frame
  const std::optional<TrajectoryAccuracy>& accuracy; ///< relative to that truth
};

/// Writes the run as one self-contained page that needs no network: figures, map and counters, with the libraries that
/// draw them. An hour's run takes a few megabytes. Throws Failure.
void write_report(const std::filesystem::path& path, const Report& report);

} // namespace locus::tools
