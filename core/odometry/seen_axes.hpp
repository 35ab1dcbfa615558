// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "core/base/pose.hpp"

namespace locus {

/// Which axes of the base the lidar sees: with hysteresis, from what the surfaces around allow to be seen. All of them
/// before the first look. One owner.
class SeenAxes {
 public:
  static constexpr double kWeakBelow = 0.01; ///< observability of an axis that is hardly seen from now on
  static constexpr double kSeenFrom = 0.02;  ///< and of one that is seen again

  /// Takes in Registration::observability, base axes. Gives back OdometryEstimate::observability.
  Vector6 observe(const Matrix6& observability_base);

  [[nodiscard]] const std::array<bool, 6>& each() const { return seen_; }
  [[nodiscard]] bool all() const;

  /// `along_base` without what is along axes that are hardly seen.
  [[nodiscard]] Vector6 part_of(Vector6 along_base) const;
  /// Information (base axes) of the axes that are seen: the little that is said of the others is said by these.
  [[nodiscard]] Matrix6 rows_of(Matrix6 information_base) const;

 private:
  std::array<bool, 6> seen_{true, true, true, true, true, true};
};

} // namespace locus
