// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locus_experiments/fault_plan.hpp"
#include "locus_experiments/plan.hpp"

namespace locus::experiments {

/// One fault of one input, from the start of the drive or in the middle of it.
struct MatrixCell {
  std::string input;               ///< as --fail of locus-replay has it
  std::string what;                ///< row of the matrix, in words
  bool from_start = false;         ///< its column
  std::vector<std::string> faults; ///< SPECs of --fail; none where the cell cannot be
  std::string impossible;          ///< why it cannot be
  std::string refusal;             ///< what locus-replay says instead of running; empty: it runs
  Interval lasting{};              ///< ends with the drive where it does not end before
  Demand demand = Demand::unharmed;
  double limit = 0;      ///< of the demand
  int silent_from_s = 0; ///< so long from the start there is no sweep, because there is no lidar

  /// Name of the run.
  [[nodiscard]] std::string configuration() const;
};

/// Row by row: all faults of an input, each from the start and mid-drive, for drives of this length. A fault mid-drive
/// lasts a minute, half the drive if that is shorter, and is over before the end.
std::vector<MatrixCell> matrix_cells(int duration_s);

/// A husky in the plant, without fault and once for each cell.
Plan plan_of_matrix(const Arguments& arguments);

/// The kind of course that all cells are driven on, and its one seed.
inline const std::string kMatrixCourse = "urban";
std::string matrix_course();

} // namespace locus::experiments
