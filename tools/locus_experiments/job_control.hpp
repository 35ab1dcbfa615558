// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "locus_experiments/arguments.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// First argument of the programs that Ninja starts besides locus-sim and locus-replay: the one that converts a run's
/// files to a row, and locus-replay with LOAM's points instead of the filters.
inline constexpr std::string_view kRowCommand = "row", kLoamReplay = "replay-with-loam-features";

/// Simulates the courses and performs the runs with Ninja, as many in parallel as the user wants, and returns their
/// rows in plan order: a measurement(), or the reason for its absence. Results of an earlier call for the same output
/// folder are reused. A course is deleted after the last run on it, unless captures are to be kept; runs at the pace of
/// the recording come last, one at a time.
///
/// All child processes end with this one. Throws tools::Failure if Ninja fails.
Results carry_out(const Plan& plan, const Arguments& arguments);

/// Implements the program of kRowCommand. Throws tools::Failure.
void write_row(std::span<char* const> arguments);

/// Returns the processors that this process may use.
std::vector<int> usable_cpus();

} // namespace locus::experiments
