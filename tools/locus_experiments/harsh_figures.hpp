// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "drivers/files/capture_folder.hpp"

namespace locus::experiments {

/// Error from which an estimate counts as lost, plus the path error caused by the lidar's mounting error.
inline constexpr double kLost_m = 0.3;

/// Computes the figures of the harsh table that are not in a drive's summary:
/// {"standing", "true_mps", "lost_after_s", "flagged_after_s", "said"}.
///
/// standing: the robot was at rest during the first second. true_mps: its largest true speed. lost_after_s: time from
/// the start to the first estimate with an error above kLost_m, with the first poses aligned; null if there is none. A
/// mounting error of the lidars of `mounting_rad` rotates the path by that angle: that share of the path is allowed on
/// top. flagged_after_s: delay until the first state that warns, degenerate or dead reckoning; null if there is none.
/// said: messages to the user, a line each, without numbers. Throws tools::Failure.
nlohmann::ordered_json harsh_figures(const std::filesystem::path& run_folder, const CaptureFolder& capture,
                                     const nlohmann::ordered_json& summary, double mounting_rad);

} // namespace locus::experiments
