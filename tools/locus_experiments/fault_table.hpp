// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// The table of faults from the runs of plan_of_faults(), into results["faults"]: "rows", one for each case that has
/// runs, and "consistency", the mean of the normalised squared errors. A row holds if what is asked of it does, if no
/// sweep is lost and none fails for want of anything but a lidar, and if a faulty motion source is found out and, once
/// well, taken back; "broken" says which of these is not so.
///
/// Numbers are medians over the seeds, of differences those of each seed's pair; the worst sigma is that of all seeds.
void judge_faults(Results& results);

/// results["faults"] as a text in Markdown, for faults.md.
std::string fault_table(const Results& results);

} // namespace locus::experiments
