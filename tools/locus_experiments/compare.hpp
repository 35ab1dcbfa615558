// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "locus_experiments/compared_rows.hpp"
#include "locus_experiments/results.hpp"

namespace locus::experiments {

/// Results of an earlier run, as the baseline of a comparison within the same experiment.
class ResultsBefore {
 public:
  /// Reads a results.json. Throws tools::Failure.
  explicit ResultsBefore(std::filesystem::path file);

  /// Throws tools::Failure if `after`, complete or not, is of another experiment: other rows, duration or seeds.
  void check_is_of(const Results& after) const;

  /// Returns a page in Markdown: each row better, worse or the same, the worst first, and the rows present in only one
  /// of the two. Throws as check_is_of() does.
  [[nodiscard]] std::string comparison_with(const Results& after) const;

 private:
  std::filesystem::path file_;
  Results results_;
  const ComparedTable* table_;
  std::vector<ComparedRow> rows_;
  std::string origin_; ///< version and machine
};

/// Writes that page as compare.md into `folder` and returns it. Throws tools::Failure.
std::string write_comparison(const ResultsBefore& before, const Results& after, const std::filesystem::path& folder);

} // namespace locus::experiments
