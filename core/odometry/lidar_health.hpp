// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/map/registration.hpp"

namespace locus {

/// Tells from what is usual at this place whether lidar still sees what it saw: the share of the points that find a
/// correspondence, and how well they fit. One owner.
class LidarHealth {
 public:
  /// Lidar placed a sweep of `registered` points, `elapsed_s` after the last.
  void learn(const Registration& registration, std::size_t registered, double elapsed_s);

  /// Fewer correspondences than half of the usual: the air is full of dust, or the lidar measures otherwise. No place
  /// changes so fast. Such a sweep is not for the map.
  [[nodiscard]] bool misses_most(const Registration& registration, std::size_t registered) const;

  /// It fits worse than sweeps do: what it was corrected for and begun from may be wrong.
  [[nodiscard]] bool is_unusual(const Registration& registration, std::size_t registered) const;

 private:
  double share_ = 0.0, fit_ = 0.0; ///< usual
  double learned_s_ = 0.0;
};

} // namespace locus
