// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

#include "accuracy/pose_pairs.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_experiments/odometry_rows.hpp"

namespace locus::experiments {

/// Error from which an estimate counts as lost, plus the path error caused by the lidar's mounting error.
inline constexpr double kLost_m = 0.3;

/// Criteria of the harsh tables: a position error within four of its standard deviations, a loss flagged within a
/// second.
inline constexpr double kMostSigmas = 4, kFlaggedWithin_s = 1;

/// Returns the time from the first pair to the first one with an error above kLost_m, first poses aligned; null if
/// there is none. A mounting error of the lidars of `mounting_rad` rotates the path by that angle: that share of the
/// path is allowed on top. Precondition: there are pairs.
nlohmann::ordered_json lost_after_s(const std::vector<PosePair>& pairs, double mounting_rad);

/// Returns {"lost_after_s", "flagged_after_s"} of a run, as in harsh_figures(). Precondition: there are pairs.
nlohmann::ordered_json loss_figures(const std::vector<PosePair>& pairs, std::span<const OdometryRow> rows,
                                    double mounting_rad);

/// Computes the figures of the harsh table that are not in a drive's summary:
/// {"standing", "true_mps", "lost_after_s", "flagged_after_s", "said"}.
///
/// standing: the robot was at rest during the first second. true_mps: its largest true speed. lost_after_s: see there.
/// flagged_after_s: delay from the loss until the first state that warns, degenerate or dead reckoning; null if there
/// is none. said: messages to the user, a line each, without numbers. Throws tools::Failure.
nlohmann::ordered_json harsh_figures(const std::filesystem::path& run_folder, const CaptureFolder& capture,
                                     const nlohmann::ordered_json& summary, double mounting_rad);

} // namespace locus::experiments
