// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/fault_plan.hpp"
#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// One fault of one input, from the start of the drive or in the middle of it.
struct MatrixCell {
  std::string input;               ///< as for --fail of locus-replay
  std::string what;                ///< matrix row, in words
  bool from_start = false;         ///< matrix column
  std::vector<std::string> faults; ///< SPECs of --fail; none if the cell is impossible
  std::string impossible;          ///< why it is impossible
  std::string refusal;             ///< expected refusal by locus-replay; empty: it runs
  Interval lasting{};              ///< at most to the end of the drive
  Demand demand = Demand::unharmed;
  double limit = 0;      ///< for the demand
  int silent_from_s = 0; ///< seconds from the start without sweeps, for lack of a lidar

  /// Returns the name of the run.
  [[nodiscard]] std::string configuration() const;
};

/// Returns the cells row by row: all faults of an input, each from the start and mid-drive, for drives of this length.
/// A fault mid-drive lasts a minute, or half the drive if shorter, and ends before the drive does.
std::vector<MatrixCell> matrix_cells(int duration_s);

/// Plans a husky in the plant, without fault and once for each cell.
Plan plan_of_matrix(const Arguments& arguments);

/// Course of all cells, with a single seed.
inline const std::string kMatrixCourse = "urban";
std::string matrix_course();

} // namespace locus::experiments
