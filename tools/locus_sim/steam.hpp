// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// A burst of steam or dust: stays where it is, grows, thins and is gone.
struct Cloud {
  Eigen::Vector3d center_m;
  double first_radius_m, last_radius_m;
  Stamp begin, end;
};

/// Clouds over time. Immutable, any thread.
class Steam {
 public:
  explicit Steam(std::vector<Cloud> clouds);

  /// Where along a ray, within a range, light is thrown back by a cloud; nothing where it passes through them all.
  [[nodiscard]] std::optional<double> range_m(const Ray& ray, double max_range_m, Stamp stamp, QuickDice& dice) const;

  [[nodiscard]] const std::vector<Cloud>& clouds() const { return clouds_; }

 private:
  std::vector<Cloud> clouds_;
  Stamp begin_;
  std::vector<std::vector<std::size_t>> in_second_; ///< since the begin: which clouds there are
};

/// How much of the light a metre of a cloud takes, 1/m: visibility is three over it (Koschmieder).
double extinction_per_m(const Cloud& cloud, Stamp stamp);
double radius_m(const Cloud& cloud, Stamp stamp);

} // namespace locus::sim
