// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gyro_bias.hpp"

#include <algorithm>

namespace locus {

namespace {

constexpr double kMemoryOfRate_sweeps = 600.0;
constexpr double kHesitation_sweeps = 10.0; ///< the noise of lidar in a sweep is as large as any bias
constexpr double kSlow_radps = 0.1;         ///< faster turns show the error of the scale

} // namespace

void GyroBias::learn(const Eigen::Vector3d& excess_rad, const Eigen::Vector3d& true_turn_rad, Duration elapsed) {
  if (elapsed <= Duration::zero() || true_turn_rad.norm() > kSlow_radps * to_seconds(elapsed))
    return;
  learned_ = std::min(learned_ + 1.0, kMemoryOfRate_sweeps);
  rate_radps_ += excess_rad / to_seconds(elapsed) / (learned_ + kHesitation_sweeps);
}

} // namespace locus
