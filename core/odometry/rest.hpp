// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/odometry/motion_filter.hpp"

namespace locus {

/// Tells whether a twist of zero is within three standard deviations of the prediction: what the sources measure does
/// not contradict a standstill.
inline bool may_rest(const MotionFilter& prediction) {
  constexpr double kSigmas = 3.0, kLeast = 1e-3; // m/s, rad/s
  const Vector6 sigma = prediction.covariance().diagonal().tail<6>().cwiseSqrt();
  return (prediction.twist_base().array().abs() < kSigmas * sigma.array() + kLeast).all();
}

} // namespace locus
