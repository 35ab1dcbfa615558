// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Figure of a row; smaller is better.
struct FigureKind {
  std::string_view name; ///< with the displayed unit
  double shown_per_unit; ///< 1000 for metres shown in mm
  int decimals;          ///< displayed
  double negligible;     ///< largest insignificant difference, whatever its ratio; in the unit of the value
};

/// Row of a table of results, the unit of comparison between two runs of the same experiment.
struct ComparedRow {
  std::string name;                           ///< stable and unique
  std::optional<bool> holds;                  ///< nothing if the row has no criterion
  std::string broken;                         ///< why it does not hold
  std::vector<std::optional<double>> figures; ///< in the order of the table's kinds; nothing if a run gave none
};

/// Experiment whose results are rows.
struct ComparedTable {
  std::string_view key; ///< of the results, as in results["faults"]
  std::vector<FigureKind> kinds;
  std::vector<ComparedRow> (*rows)(const Results& results);
};

/// Returns the table of these results, complete or not; nullptr if their experiment has no rows.
const ComparedTable* table_of(const Results& results);

} // namespace locus::experiments
