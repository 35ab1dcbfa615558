// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// Measures a run on a capture as stored in results.json: its summary.json, the position error over time (at most a few
/// hundred points) and its quantiles, and when it stopped giving output; for recordings, recording_figures(). Throws
/// tools::Failure if the run has not written its files to `folder`.
nlohmann::ordered_json measurement(const Run& run, const std::filesystem::path& folder,
                                   const std::filesystem::path& capture);

/// Reads a file written by a run. Throws tools::Failure if it is missing or invalid.
nlohmann::ordered_json read_json(const std::filesystem::path& file);

/// Returns the name of the processor, to distinguish figures from several machines.
std::string machine_name();

} // namespace locus::experiments
