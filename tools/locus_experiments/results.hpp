// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::experiments {

/// Contents of results.json: {"version", "simulated", "duration_s", "runs": [...], "robustness": [...]}. A run is a
/// measurement(), or its course and configuration with "failed", the reason for its absence. With --faults "faults"
/// replaces "robustness": {"seeds", "consistency_runs", "rows": [...], "consistency"}, of judge_faults(); with
/// --fault-matrix "matrix": {"cells": [...]}, of judge_matrix(); with --harsh "harsh": {"seeds", "only", "rows":
/// [...]}, of judge_harsh(); with --subsets "subsets": {"seeds", "starts", "only" or "places", "without_truth", "rows":
/// [...]}, of judge_subsets(). A run that was refused as expected has "refused", the message of locus-replay. With
/// --accuracy it holds the results of accuracy_of().
using Results = nlohmann::ordered_json;

/// Reads a results.json. Throws tools::Failure.
Results read_results(const std::filesystem::path& file);

/// Computes Table III from the runs: the effect of each failure relative to the run of the same course without it.
///
/// The paper's terms are interpreted as follows: Stops, no odometry in the last second; Errors, the largest position
/// error grew by more than 20 cm; OK, otherwise.
void judge_robustness(Results& results);

/// Evaluates the runs by judge_robustness(), judge_faults(), judge_matrix() or judge_harsh().
void judge(Results& results);

/// Writes results.json and experiments.html, faults.md, matrix.md, harsh.md, subsets.md or accuracy.md, and returns the
/// path of the latter. Throws tools::Failure.
std::filesystem::path write_results(const std::filesystem::path& folder, const Results& results);

} // namespace locus::experiments
