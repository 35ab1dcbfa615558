// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// The matrix of faults from the runs of plan_of_matrix(), into results["matrix"]["cells"], one for each cell that has
/// a run or cannot be.
///
/// A cell holds if locus-replay ended with status 0 (without any lidar: 1, and said so), if no sweep is lost, if the
/// error is as bounded as is asked, and if the fault is told: by a counter that differs from the run without fault, its
/// own input's or that of one which suffers from it. A fault that moves neither the mean nor the largest error by a
/// millimetre needs no counter.
void judge_matrix(Results& results);

/// results["matrix"] as a text in Markdown, for matrix.md: a line for each fault of each input.
std::string matrix_table(const Results& results);

} // namespace locus::experiments
