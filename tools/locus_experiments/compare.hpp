// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "locus_experiments/compared_rows.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// The results of an earlier run, for others of the same experiment to be compared with.
class ResultsBefore {
 public:
  /// Reads a results.json. Throws tools::Failure.
  explicit ResultsBefore(std::filesystem::path file);

  /// Throws tools::Failure where `after`, whether or not its runs are done, is not of the same experiment: other rows,
  /// another duration, other seeds.
  void check_is_of(const Results& after) const;

  /// A page in Markdown: each row better, worse or the same, the worst first, and the rows that only one of them has.
  /// Throws as check_is_of() does.
  [[nodiscard]] std::string comparison_with(const Results& after) const;

 private:
  std::filesystem::path file_;
  Results results_;
  const ComparedTable* table_;
  std::vector<ComparedRow> rows_;
  std::string origin_; ///< version and machine
};

/// Writes that page as compare.md into `folder`, and gives it. Throws tools::Failure.
std::string write_comparison(const ResultsBefore& before, const Results& after, const std::filesystem::path& folder);

} // namespace locus::experiments
