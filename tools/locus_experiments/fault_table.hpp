// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Computes the table of faults from the runs of plan_of_faults(), into results["faults"]: "rows", one for each case
/// with runs, and "consistency", the mean NEES. A row holds if its criterion does, if no sweep is lost and none fails
/// except for lack of a lidar, and if a faulty motion source is detected and, once recovered, used again; "broken"
/// lists the violations.
///
/// Numbers are medians over the seeds, differences are taken per seed; the worst sigma is that of all seeds.
void judge_faults(Results& results);

/// Formats results["faults"] in Markdown, for faults.md.
std::string fault_table(const Results& results);

} // namespace locus::experiments
