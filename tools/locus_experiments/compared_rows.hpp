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

/// A figure of a row, of which less is better.
struct FigureKind {
  std::string_view name; ///< with the unit that it is shown in
  double shown_per_unit; ///< 1000 for metres shown in mm
  int decimals;          ///< as shown
  double negligible;     ///< difference that counts for nothing, however large a share it is; the unit of the value
};

/// One row of a table of results: what two runs of the same experiment are compared by.
struct ComparedRow {
  std::string name;                           ///< the same before and after, and of no other row
  std::optional<bool> holds;                  ///< nothing where nothing is asked of it
  std::string broken;                         ///< why it does not hold
  std::vector<std::optional<double>> figures; ///< in the order of the table's kinds; nothing where a run gave none
};

/// An experiment whose results are rows.
struct ComparedTable {
  std::string_view key; ///< of the results, as in results["faults"]
  std::vector<FigureKind> kinds;
  std::vector<ComparedRow> (*rows)(const Results& results);
};

/// The table of these results, whether or not its runs are done; nullptr where they are of an experiment without rows.
const ComparedTable* table_of(const Results& results);

} // namespace locus::experiments
