// SPDX-License-Identifier: Apache-2.0
#include "core/sources/registration_feedback.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace locus {
namespace {

constexpr double kBetweenSweeps_s = 0.1;
constexpr double kAllowed_m = 0.01, kAllowed_rad = 0.2 * kRadPerDeg; ///< error of a healthy source in a sweep

/// Returns an innovation that is off by `off` standard deviations of a healthy source along an axis. The others know
/// each axis exactly.
Innovation off_by(double sigmas, int axis, double elapsed_s = kBetweenSweeps_s) {
  Innovation innovation;
  innovation.variance.setConstant(1e-6);
  innovation.value[axis] = sigmas * (axis < 3 ? kAllowed_m : kAllowed_rad) / elapsed_s;
  return innovation;
}

TEST(RegistrationFeedback, RatioIsTheSquaredErrorOverTheGate) {
  for (int axis = 0; axis < 6; ++axis) {
    EXPECT_NEAR(*test_ratio(off_by(1.0, axis), kBetweenSweeps_s), 1.0 / kInnovationGate, 1e-9) << axis;
    EXPECT_NEAR(*test_ratio(off_by(3.0, axis), kBetweenSweeps_s), 9.0 / kInnovationGate, 1e-9) << axis;
  }
}

TEST(RegistrationFeedback, ErrorsOfAllAxesAddUp) {
  Innovation innovation = off_by(2.0, 0);
  innovation.value[5] = off_by(3.0, 5).value[5];
  EXPECT_NEAR(*test_ratio(innovation, kBetweenSweeps_s), 13.0 / kInnovationGate, 1e-9);
}

TEST(RegistrationFeedback, LidarDisagreesBeyondTheGateOnly) {
  const double gate = std::sqrt(kInnovationGate);
  EXPECT_EQ(opinion_on(off_by(0.999 * gate, 0), kBetweenSweeps_s), LidarOpinion::agrees);
  EXPECT_EQ(opinion_on(off_by(1.001 * gate, 0), kBetweenSweeps_s), LidarOpinion::disagrees);
  EXPECT_EQ(opinion_on(off_by(-1.001 * gate, 0), kBetweenSweeps_s), LidarOpinion::disagrees);
}

TEST(RegistrationFeedback, AllowedErrorIsOneOfTheDistance) {
  // The same distance in a sweep of half the length is twice the speed.
  EXPECT_NEAR(*test_ratio(off_by(2.0, 0, 0.05), 0.05), *test_ratio(off_by(2.0, 0, 0.1), 0.1), 1e-9);
}

TEST(RegistrationFeedback, KnownErrorsOfAMotionAreAllowed) {
  Innovation innovation = off_by(1.0, 0);
  innovation.known[0] = 3.0 * std::pow(kAllowed_m / kBetweenSweeps_s, 2);
  EXPECT_NEAR(*test_ratio(innovation, kBetweenSweeps_s), 0.25 / kInnovationGate, 1e-9);
}

TEST(RegistrationFeedback, UncertaintyOfTheOthersIsNoFaultOfTheSource) {
  Innovation innovation = off_by(1.0, 0);
  innovation.others[0] = 0.5 * std::pow(kAllowed_m / kBetweenSweeps_s, 2);
  EXPECT_NEAR(*test_ratio(innovation, kBetweenSweeps_s), 1.0 / 1.5 / kInnovationGate, 1e-9);
}

TEST(RegistrationFeedback, AxesThatTheOthersKnowWorseAreNotCompared) {
  Innovation innovation = off_by(100.0, 0);
  innovation.others[0] = 1.1 * std::pow(kAllowed_m / kBetweenSweeps_s, 2);
  EXPECT_EQ(*test_ratio(innovation, kBetweenSweeps_s), 0.0);
  EXPECT_EQ(opinion_on(innovation, kBetweenSweeps_s), LidarOpinion::agrees) << "by the other axes";
}

TEST(RegistrationFeedback, AxesThatTheSourceDoesNotMeasureAreNotCompared) {
  Innovation of_gyro = off_by(100.0, 0);
  of_gyro.variance.head<3>().setZero();
  EXPECT_EQ(*test_ratio(of_gyro, kBetweenSweeps_s), 0.0);
}

TEST(RegistrationFeedback, WithoutAnAxisToCompareThereIsNoOpinion) {
  Innovation unobserved = off_by(100.0, 0);
  unobserved.others.setConstant(1e6);
  EXPECT_FALSE(test_ratio(unobserved, kBetweenSweeps_s));
  EXPECT_EQ(opinion_on(unobserved, kBetweenSweeps_s), LidarOpinion::none);
  EXPECT_EQ(opinion_on(Innovation{}, kBetweenSweeps_s), LidarOpinion::none);
}

} // namespace
} // namespace locus
