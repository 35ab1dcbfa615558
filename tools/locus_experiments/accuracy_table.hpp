// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Why a run with truth is not what its user hopes for, a few words each; empty if all holds. It holds if no position,
/// the last one included, is off by more than a percent of the way (3 cm are always allowed, the range error of the
/// lidars by their data sheets) or by more than three times what it says, and no sweep is lost.
std::vector<std::string> what_does_not_hold(const Results& run);

/// What accuracy_of() found, in Markdown.
std::string accuracy_table(const Results& results);

} // namespace locus::experiments
