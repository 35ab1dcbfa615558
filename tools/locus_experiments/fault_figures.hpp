// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include <nlohmann/json.hpp>

#include "drivers/files/capture_folder.hpp"
#include "drivers/files/motion_files.hpp"
#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// What the table of faults wants to know of a run beyond its summary:
/// {"length_m", "added_m", "told", "growth": {"along", "across"}, "sources": {NAME: {"added_m", "ape_mean_m"}}}.
///
/// length_m is the way that the robot goes; added_m is the error of the motion across the interval; told the share of
/// sweeps flagged as degenerate or dead reckoning since its beginning; growth by how much the variance of the position
/// along the way and across it has grown from 5 m of way to the farthest place; sources the same errors of the motion
/// sources alone. Throws tools::Failure.
nlohmann::ordered_json fault_figures(const Interval& interval, const std::filesystem::path& run_folder,
                                     const CaptureFolder& capture);

/// The error of the translation from the last pose before the interval to the last one in it, metres. 0 where there is
/// none.
double error_added_m(std::span<const StampedPose> estimates, std::span<const StampedPose> truth,
                     const Interval& interval);

} // namespace locus::experiments
