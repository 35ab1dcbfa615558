// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::experiments {

/// What results.json holds: {"version", "simulated", "duration_s", "runs": [...], "robustness": [...]}. A run is a
/// measurement(), or its course and configuration with "failed", the reason why there is none. With --faults "faults"
/// stands in place of "robustness": {"seeds", "consistency_runs", "rows": [...], "consistency"}, of judge_faults();
/// with
/// --fault-matrix "matrix": {"cells": [...]}, of judge_matrix(); with --harsh "harsh": {"seeds", "only", "rows":
/// [...]}, of judge_harsh(). A run that was to be refused, and was, has "refused", what locus-replay said. With
/// --accuracy it holds what accuracy_of() says.
using Results = nlohmann::ordered_json;

/// Reads a results.json. Throws tools::Failure.
Results read_results(const std::filesystem::path& file);

/// Table III from the runs: what each failure did, beside the run of the same course without it.
///
/// The paper's words are taken as: Stops, no odometry in the last second; Errors, the largest position error has grown
/// by more than 20 cm; OK, the rest.
void judge_robustness(Results& results);

/// What the runs say together: judge_robustness(), judge_faults(), judge_matrix() or judge_harsh().
void judge(Results& results);

/// Writes results.json and experiments.html, faults.md, matrix.md, harsh.md or accuracy.md; that is what it returns.
/// Throws tools::Failure.
std::filesystem::path write_results(const std::filesystem::path& folder, const Results& results);

} // namespace locus::experiments
