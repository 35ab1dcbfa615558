// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Burst of steam or dust: stationary; it grows, thins and disappears.
struct Cloud {
  Eigen::Vector3d center_m;
  double first_radius_m, last_radius_m;
  Stamp begin, end;
};

/// Clouds over time. Immutable, any thread.
class Steam {
 public:
  explicit Steam(std::vector<Cloud> clouds);

  /// Returns the distance along a ray at which a cloud scatters the light back; nothing if it passes through all of
  /// them.
  [[nodiscard]] std::optional<double> range_m(const Ray& ray, double max_range_m, Stamp stamp, QuickDice& dice) const;

  [[nodiscard]] const std::vector<Cloud>& clouds() const { return clouds_; }

 private:
  std::vector<Cloud> clouds_;
  Stamp begin_;
  std::vector<std::vector<std::size_t>> in_second_; ///< clouds present in each second since the start
};

/// Returns the extinction coefficient of a cloud, 1/m: visibility is three over it (Koschmieder).
double extinction_per_m(const Cloud& cloud, Stamp stamp);
double radius_m(const Cloud& cloud, Stamp stamp);

} // namespace locus::sim
