// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/lidar_health.hpp"

#include <algorithm>

namespace locus {

namespace {

constexpr double kMemory_s = 1.0;
constexpr double kLeastOfUsual = 0.5; ///< the lowest in good drives is 0.78
constexpr double kUnusualFit = 0.85;
constexpr double kPatience_s = 5.0; ///< a lidar with a fault that lasts longer is used as it is (chosen, not measured)

double mean_fit(const Registration& registration) {
  return fit_of(registration) / static_cast<double>(std::max<std::size_t>(registration.points, 1));
}

} // namespace

void LidarHealth::learn(const Registration& registration, double elapsed_s) {
  learned_s_ = std::min(learned_s_ + elapsed_s, kMemory_s);
  const double weight = std::min(1.0, elapsed_s / std::max(learned_s_, 1e-9));
  overlap_ += weight * (registration.overlap() - overlap_);
  fit_ += weight * (mean_fit(registration) - fit_);
}

bool LidarHealth::lacks_correspondences(const Registration& registration) const {
  return registration.overlap() < kLeastOfUsual * overlap_;
}

bool LidarHealth::is_unusual(const Registration& registration) const {
  return mean_fit(registration) < kUnusualFit * fit_;
}

bool LidarHealth::is_by_chance(const Registration& registration) const {
  return is_unusual(registration) && is_spread_evenly(registration);
}

void LidarHealth::forgive(const Registration& registration, double elapsed_s) {
  fit_ += std::min(1.0, elapsed_s / kPatience_s) * (mean_fit(registration) - fit_);
}

} // namespace locus
