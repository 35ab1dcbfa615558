// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

namespace locus::experiments {

/// Computes the figures of the table of subsets that are not in a run's summary: {"tracking", "lost_after_s",
/// "flagged_after_s", "odometry": {NAME: {"mean_m", "worst_m", "lost_after_s"}}}.
///
/// tracking: share of the estimates in that state. lost_after_s, flagged_after_s: as in harsh_figures(). odometry: each
/// source of a capture folder by itself, without lidar: position error of its own poses over the time of the run,
/// aligned as an estimate's. Throws tools::Failure.
nlohmann::ordered_json subset_figures(const std::filesystem::path& run_folder, const std::filesystem::path& recording,
                                      double mounting_rad);

} // namespace locus::experiments
