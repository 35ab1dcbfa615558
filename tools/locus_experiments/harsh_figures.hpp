// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "drivers/files/capture_folder.hpp"

namespace locus::experiments {

/// From here on an estimate is lost, beside what a lidar that is mounted askew turns the way by.
inline constexpr double kLost_m = 0.3;

/// What the harsh table wants to know of a drive beyond its summary:
/// {"standing", "true_mps", "lost_after_s", "flagged_after_s", "said"}.
///
/// standing: the robot did not move in the first second of the drive. true_mps: the largest speed it truly had.
/// lost_after_s: from the start to the first estimate that is farther than kLost_m from the truth, with the first poses
/// aligned; null if there is none. Lidars that are turned by `mounting_rad` against what the user believes see the base
/// go so much beside where it goes: that share of the way is allowed on top. flagged_after_s: from then to the first
/// state that warns, degenerate or dead reckoning; null if none does. said: what the user was told, a line each,
/// numbers left out. Throws tools::Failure.
nlohmann::ordered_json harsh_figures(const std::filesystem::path& run_folder, const CaptureFolder& capture,
                                     const nlohmann::ordered_json& summary, double mounting_rad);

} // namespace locus::experiments
