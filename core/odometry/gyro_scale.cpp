// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gyro_scale.hpp"

#include "core/base/pose.hpp"

namespace locus {

namespace {

/// What lidar and a good gyro differ by anyway. Of a gyro that has not turned it is as if it had once been wrong about
/// a turn of that size, by all of it.
constexpr double kNoise_rad = 0.2 * kRadPerDeg;
constexpr double kNoiseSquare = kNoise_rad * kNoise_rad;

} // namespace

void GyroScale::learn(const Eigen::Vector3d& excess_rad, const Eigen::Vector3d& read_rad) {
  excess_squares_.array() += (excess_rad.array().square() - kNoiseSquare).max(0.0);
  read_squares_ += read_rad.cwiseAbs2();
}

Eigen::Vector3d GyroScale::variance(const Eigen::Vector3d& read_rad) const {
  return read_rad.array().square() * (excess_squares_.array() + kNoiseSquare) / (read_squares_.array() + kNoiseSquare);
}

} // namespace locus
