// SPDX-License-Identifier: Apache-2.0
#include "core/sources/registration_feedback.hpp"

namespace locus {

namespace {

/// What a source may be off by in a sweep before lidar objects, one standard deviation. Above what a healthy one is off
/// by on bad ground, well below spinning wheels: a prior that is merely poor has its weight for that.
const Vector6 kHonestError = along_each_axis(0.01, 0.2);

} // namespace

LidarOpinion opinion_on(const Vector6& error, const Matrix6& lidar_information) {
  constexpr double kMaxChiSquare = 38.0; ///< exceeded once in a million by six honest axes
  double chi_square = 0.0;
  bool sees = false;
  for (int axis = 0; axis < 6; ++axis) {
    const double variance = kHonestError[axis] * kHonestError[axis];
    if (lidar_information(axis, axis) * variance < 1.0)
      continue;
    sees = true;
    chi_square += error[axis] * error[axis] / (variance + 1.0 / lidar_information(axis, axis));
  }
  if (!sees)
    return LidarOpinion::none;
  return chi_square > kMaxChiSquare ? LidarOpinion::disagrees : LidarOpinion::agrees;
}

} // namespace locus
