// SPDX-License-Identifier: Apache-2.0
#include "core/sources/registration_feedback.hpp"

namespace locus {

namespace {

/// Error in a sweep that a source is allowed before lidar disagrees, one standard deviation. Larger than the error of a
/// healthy source on bad ground, much smaller than that of spinning wheels: a prior that is merely poor has a low
/// weight.
const Vector6 kHonestError = along_each_axis(0.01, 0.2);

} // namespace

std::optional<double> test_ratio(const Innovation& innovation, double elapsed_s) {
  std::optional<double> ratio;
  for (int axis = 0; axis < 6; ++axis) {
    const double honest = kHonestError[axis] * kHonestError[axis] / (elapsed_s * elapsed_s) + innovation.known[axis];
    if (innovation.variance[axis] == 0.0 || innovation.others[axis] > honest)
      continue;
    const double squared = innovation.value[axis] * innovation.value[axis] / (honest + innovation.others[axis]);
    ratio = ratio.value_or(0.0) + squared / kInnovationGate;
  }
  return ratio;
}

LidarOpinion opinion_on(const Innovation& innovation, double elapsed_s) {
  const std::optional<double> ratio = test_ratio(innovation, elapsed_s);
  if (!ratio)
    return LidarOpinion::none;
  return *ratio > 1.0 ? LidarOpinion::disagrees : LidarOpinion::agrees;
}

} // namespace locus
