// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Adds "rows" to results["harsh"], one for each course, imperfection and choice of sensors with runs:
/// {"course", "imperfection", "sensors", "drives", "standing", "failed", "median_m", "worst_m", "worst_sigma",
/// "nees_10m", "claimed_mps", "true_mps", "lost", "flagged", "flagged_after_s", "said", "broken", "holds"}.
///
/// drives: those that ran; standing: those of them that start at rest. median_m: median of their mean position errors;
/// worst_m: largest position error of any. claimed_mps and true_mps: largest estimated and true speed. lost: drives
/// with an error ever above kLost_m; flagged: those of them that warn after that, the last one flagged_after_s later.
/// said: {"text", "drives"}. broken: violated criteria.
void judge_harsh(Results& results);

/// Formats the rows as a page in Markdown.
std::string harsh_table(const Results& results);

} // namespace locus::experiments
