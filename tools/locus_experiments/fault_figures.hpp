// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include <nlohmann/json.hpp>

#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// Computes the figures of the table of faults that are not in a run's summary:
/// {"length_m", "added_m", "told", "growth": {"along", "across"}, "sources": {NAME: {"added_m", "ape_mean_m"}}}.
///
/// length_m: path length of the robot; added_m: error of the motion across the interval; told: share of sweeps flagged
/// as degenerate or dead reckoning since its start; growth: factor by which the variance of the position along and
/// across the path grows from 5 m of path to the farthest place; sources: the same errors of each motion source alone.
/// Throws tools::Failure.
nlohmann::ordered_json fault_figures(const Interval& interval, const std::filesystem::path& run_folder,
                                     const CaptureFolder& capture);

/// Returns the translation error from the last pose before the interval to the last one in it, metres; 0 without such
/// poses.
double error_added_m(std::span<const StampedPose> estimates, std::span<const StampedPose> truth,
                     const Interval& interval);

} // namespace locus::experiments
