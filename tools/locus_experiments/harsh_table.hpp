// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Adds "rows" to results["harsh"], one for each course, imperfection and choice of sensors of which there are runs:
/// {"course", "imperfection", "sensors", "drives", "standing", "failed", "median_m", "worst_m", "worst_sigma",
/// "nees_10m", "claimed_mps", "true_mps", "lost", "flagged", "flagged_after_s", "said", "broken", "holds"}.
///
/// drives: those that ran, of them standing at first. median_m: of their mean position errors; worst_m: the largest
/// position error of any. claimed_mps and true_mps: the largest speed that any estimate claims, and that the robot had.
/// lost: drives that are ever farther than kLost_m off; flagged: those of them that warn after that, the last one
/// flagged_after_s later. said: {"text", "drives"}. broken: what is not as asked.
void judge_harsh(Results& results);

/// The rows as a page in Markdown.
std::string harsh_table(const Results& results);

} // namespace locus::experiments
