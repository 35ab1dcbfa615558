// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "piece.hpp"

namespace locus::soak {

/// What the pieces say together. Growth and drift need hours of stamps; before, they are not judged.
struct Verdict {
  /// Straight line through the memory of all pieces but those of the first hour of a process, which buys it. Each
  /// process, and what it drove with restarts, may have a level of its own, but all have one slope.
  std::optional<double> growth_mb_per_hour;
  /// Median over the pieces of the last hour to that over the first hour.
  std::optional<double> cpu_drift, latency_drift;
  std::vector<std::string> broken; ///< a line for each bound that does not hold
};
Verdict judge(std::span<const Piece> pieces);

} // namespace locus::soak
