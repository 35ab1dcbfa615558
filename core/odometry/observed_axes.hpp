// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "core/base/pose.hpp"

namespace locus {

/// Axes of the base that lidar observes: with hysteresis, from the observability that the surroundings allow. All of
/// them initially. One owner.
class ObservedAxes {
 public:
  static constexpr double kWeakBelow = 0.01;    ///< observability below which an axis becomes weakly observed
  static constexpr double kObservedFrom = 0.02; ///< observability from which it is observed again

  /// Updates the axes from Registration::observability, base axes. Returns OdometryEstimate::observability.
  Vector6 observe(const Matrix6& observability_base);

  [[nodiscard]] const std::array<bool, 6>& each() const { return observed_; }
  [[nodiscard]] bool all() const;

  /// Returns whether lidar observes the forward motion.
  [[nodiscard]] bool forward() const { return observed_[0]; }

  /// Returns `along_base` with the weakly observed axes set to zero.
  [[nodiscard]] Vector6 part_of(Vector6 along_base) const;

 private:
  std::array<bool, 6> observed_{true, true, true, true, true, true};
};

} // namespace locus
