// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Replays every drive with each subset of its sources and each view, and adds to `asked` "runs", with "drive",
/// "view_deg", "subset", "sound" and "unsound" (names of sources) each, and the rows of judge_subsets(). The drives are
/// those of the recordings with truth in the user's folders, the others are listed as "without_truth"; or, without
/// folders, of the harsh courses. Throws tools::Failure if no recording has truth.
Results results_of_subsets(const Arguments& arguments, Results asked);

} // namespace locus::experiments
