// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// What a run on a capture says of itself and how far it was from the truth, as it stands in results.json: its
/// summary.json, the position error over time (at most a few hundred points) and its quantiles, and when it fell
/// silent; of recordings recording_figures(). Throws tools::Failure where the run has not left its files in `folder`.
nlohmann::ordered_json measurement(const Run& run, const std::filesystem::path& folder,
                                   const std::filesystem::path& capture);

/// A file that a run has left. Throws tools::Failure where it is missing or something else.
nlohmann::ordered_json read_json(const std::filesystem::path& file);

/// The processor, for figures from several machines.
std::string machine_name();

} // namespace locus::experiments
