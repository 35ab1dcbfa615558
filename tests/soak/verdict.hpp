// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "piece.hpp"

namespace locus::soak {

/// Judgement over all pieces. Growth and drift need hours of stamps and are not judged before.
struct Verdict {
  /// Slope of a line fitted to the memory of all pieces except those of the first hour of a process, in which it
  /// allocates. Each process, and its pieces with restarts, have their own offset; all share one slope.
  std::optional<double> growth_mb_per_hour;
  /// Ratio of the medians over the pieces of the last and the first hour.
  std::optional<double> cpu_drift, latency_drift;
  std::vector<std::string> broken; ///< one line per violated bound
};
Verdict judge(std::span<const Piece> pieces);

} // namespace locus::soak
