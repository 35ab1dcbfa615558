// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/prior_statistics.hpp"

#include <algorithm>

namespace locus {

namespace {

constexpr double kMemoryOfNoise_sweeps = 30.0;
constexpr double kMemoryOfBias_sweeps = 100.0; ///< long enough for the noise to go out

/// An axis counts as seen by the lidar where its points outweigh the prior by this much.
constexpr double kLidarDominates = 4.0;

} // namespace

PriorStatistics::PriorStatistics(const PriorExpectation& expectation)
    : variance_(expectation.sigma.cwiseAbs2()), least_variance_(expectation.least_sigma.cwiseAbs2()),
      bias_(expectation.bias) {}

void PriorStatistics::learn(const Vector6& difference, const Matrix6& lidar_information) {
  for (int axis = 0; axis < 6; ++axis) {
    if (lidar_information(axis, axis) * variance_[axis] < kLidarDominates)
      continue;
    learned_[axis] = std::min(learned_[axis] + 1.0, kMemoryOfBias_sweeps);
    const double memory_sweeps = std::min(learned_[axis], kMemoryOfNoise_sweeps);
    variance_[axis] += (difference[axis] * difference[axis] - variance_[axis]) / (memory_sweeps + 1.0);
    bias_[axis] += (difference[axis] - bias_[axis]) / (learned_[axis] + 1.0);
    variance_[axis] = std::max(variance_[axis], least_variance_[axis]);
  }
}

/// A mean that the noise of the samples may have made says nothing.
Vector6 PriorStatistics::bias(double periods) const {
  const Vector6 of_noise = (learned_.array() > 0.0).select(variance_.array() / learned_.array().max(1.0), 0.0);
  return periods * (bias_.cwiseAbs2() - of_noise).cwiseMax(0.0).cwiseSqrt();
}

Vector6 PriorStatistics::variance(double periods) const { return variance_ * (periods * periods); }

} // namespace locus
