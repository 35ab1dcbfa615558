// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Adds "rows" to results["subsets"], one for each drive and view: {"drive", "view_deg", "subsets": [{"subset",
/// "sound", "mean_m", "worst_m", "worst_sigma", "tracking", "good"}, or {"subset", "sound", "failed"}], "best",
/// "ratio", "verdict", "broken", "holds"}.
///
/// The first subset is all sources; odometry alone has neither "worst_sigma" nor "tracking". sound: none of its sources
/// has larger errors than a real one. good: never off by more than kLost_m, as in harsh_figures(). best: sound subset
/// with the least mean error; ratio: mean error with all sources over its own, errors below a millimetre counted as
/// one; both null without a sound subset. verdict: "holds"; "flagged": no sound subset is good, nor are all sources,
/// and the state warns of that within a second while the covariance holds the error; "broken"; "failed": no run with
/// all sources.
void judge_subsets(Results& results);

/// Formats the rows as a page in Markdown.
std::string subset_table(const Results& results);

} // namespace locus::experiments
