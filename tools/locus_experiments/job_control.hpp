// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// First argument of the programs that Ninja starts besides locus-sim and locus-replay: the one that makes a row of
/// what a run has left, and locus-replay with LOAM's points in place of the filters.
inline constexpr std::string_view kRowCommand = "row", kLoamReplay = "replay-with-loam-features";

/// Has Ninja simulate the courses and do the runs, as many of them at the same time as the user wants, and gives their
/// rows in the order of the plan: a measurement(), or the reason why there is none. What an earlier call did for the
/// same output folder is not done again. A course is gone after the last run on it, unless they are to be kept; runs at
/// the pace of the recording come when all others are over, one at a time.
///
/// Whoever ends this process ends all that it started. Throws tools::Failure where Ninja does not do its work.
Results carry_out(const Plan& plan, const Arguments& arguments);

/// The program behind kRowCommand. Throws tools::Failure.
void write_row(std::span<char* const> arguments);

/// Processors that this process may run on.
std::vector<int> usable_cpus();

} // namespace locus::experiments
