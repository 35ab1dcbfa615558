// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/lidar_health.hpp"

#include <algorithm>

namespace locus {

namespace {

constexpr double kMemory_s = 1.0;
constexpr double kLeastOfUsual = 0.5; ///< the lowest in good drives is 0.78
constexpr double kUnusualFit = 0.85;

double share(std::size_t part, std::size_t all) {
  return static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(all, 1));
}

} // namespace

void LidarHealth::learn(const Registration& registration, std::size_t registered, double elapsed_s) {
  learned_s_ = std::min(learned_s_ + elapsed_s, kMemory_s);
  const double weight = std::min(1.0, elapsed_s / std::max(learned_s_, 1e-9));
  share_ += weight * (share(registration.inliers, registered) - share_);
  fit_ += weight * (fit_of(registration) / static_cast<double>(std::max<std::size_t>(registered, 1)) - fit_);
}

bool LidarHealth::misses_most(const Registration& registration, std::size_t registered) const {
  return share(registration.inliers, registered) < kLeastOfUsual * share_;
}

bool LidarHealth::is_unusual(const Registration& registration, std::size_t registered) const {
  return fit_of(registration) < kUnusualFit * fit_ * static_cast<double>(registered);
}

} // namespace locus
