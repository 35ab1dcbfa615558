// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace locus::tools {

/// Quantiles of a set of values by the nearest-rank method: each is one of the values. Zeros for an empty set.
class Quantiles {
 public:
  explicit Quantiles(std::vector<double> values) : sorted_(std::move(values)) { std::ranges::sort(sorted_); }

  /// Returns the smallest value that is no less than `share`, 0..1, of all.
  [[nodiscard]] double at(double share) const {
    if (sorted_.empty())
      return 0.0;
    const double rank = std::ceil(share * static_cast<double>(sorted_.size()));
    return sorted_[static_cast<std::size_t>(std::max(1.0, rank)) - 1];
  }

  /// Returns the median; for an even number the mean of the two in the middle.
  [[nodiscard]] double median() const {
    if (sorted_.empty())
      return 0.0;
    return 0.5 * (sorted_[(sorted_.size() - 1) / 2] + sorted_[sorted_.size() / 2]);
  }

 private:
  std::vector<double> sorted_;
};

} // namespace locus::tools
