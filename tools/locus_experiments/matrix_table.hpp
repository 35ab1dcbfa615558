// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Computes the matrix of faults from the runs of plan_of_matrix(), into results["matrix"]["cells"], one for each cell
/// with a run and each impossible one.
///
/// A cell holds if locus-replay exited with status 0 (without any lidar: with 1 and the reason), no sweep is lost, the
/// error is within its bound, and the fault is reported: a counter of its own input, or of one that depends on it,
/// differs from the fault-free run. A fault that changes neither the mean nor the largest error by a millimetre needs
/// no counter.
void judge_matrix(Results& results);

/// Formats results["matrix"] in Markdown, for matrix.md: a line for each fault of each input.
std::string matrix_table(const Results& results);

} // namespace locus::experiments
