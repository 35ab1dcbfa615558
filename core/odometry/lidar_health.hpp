// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/map/registration.hpp"

namespace locus {

/// Compares the share of points with a correspondence, and how well they fit, with the values of the last second, to
/// detect dust or a fault of the lidar. One owner.
class LidarHealth {
 public:
  /// Learns from an accepted registration, `elapsed_s` after the last one.
  void learn(const Registration& registration, double elapsed_s);

  /// Returns whether there are fewer correspondences than half of the usual: dust or a lidar fault, since surroundings
  /// do not change that fast. Such a sweep must not enter the map.
  [[nodiscard]] bool lacks_correspondences(const Registration& registration) const;

  /// Returns whether the fit is worse than usual: the de-skew or the prior may be wrong.
  [[nodiscard]] bool is_unusual(const Registration& registration) const;

  /// Returns whether the points fit by chance: worse than usual, and spread evenly about their surfaces. Either the
  /// registration or the lidar is wrong.
  [[nodiscard]] bool is_by_chance(const Registration& registration) const;

  /// Follows a registration that was rejected because its points fit by chance, `elapsed_s` after the last sweep:
  /// faults pass, and what lasts for seconds becomes usual.
  void forgive(const Registration& registration, double elapsed_s);

 private:
  double overlap_ = 0.0, fit_ = 0.0; ///< usual values
  double learned_s_ = 0.0;
};

} // namespace locus
