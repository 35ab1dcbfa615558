// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Returns the failed criteria of a run with truth, a few words each; empty if it passes. It passes if no position,
/// including the last, is off by more than one percent of the path (3 cm are always allowed, the range error of the
/// lidars by their data sheets) or by more than three of its standard deviations, and no sweep is lost.
std::vector<std::string> what_does_not_hold(const Results& run);

/// Formats the results of accuracy_of() in Markdown.
std::string accuracy_table(const Results& results);

} // namespace locus::experiments
