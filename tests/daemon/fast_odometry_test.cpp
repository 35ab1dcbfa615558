// SPDX-License-Identifier: Apache-2.0
#include "daemon/fast_odometry.hpp"

#include <gtest/gtest.h>

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;

constexpr double kTurnRate_radps = 0.7;
constexpr double kSpeed_mps = 1.3;

/// Constant motion forward and to the left.
Vector6 turning() {
  Vector6 twist = Vector6::Zero();
  twist[0] = kSpeed_mps;
  twist[5] = kTurnRate_radps;
  return twist;
}

Vector6 straight_on() {
  Vector6 twist = Vector6::Zero();
  twist[0] = kSpeed_mps;
  return twist;
}

Stamp at(Duration since_start) { return stamp_from_ns(0) + since_start; }

/// A gyro every 5 ms and, optionally, wheels every 20 ms; both measure a constant twist from time 0 on.
class ArcDrive {
 public:
  ArcDrive(const Vector6& twist_base, Duration gyro_until, Duration wheels_until) : twist_base_(twist_base) {
    for (Duration t{}; t <= std::max(gyro_until, wheels_until); t += milliseconds{5}) {
      const double t_s = to_seconds(t);
      if (t <= wheels_until && t % milliseconds{20} == Duration{})
        sources_.add(SourceId{0}, OdometrySample{at(t), at(t), se3_exp(t_s * twist_base), 1.0});
      if (t <= gyro_until) // no two samples are equal: repeated ones count as frozen
        sources_.add(SourceId{1}, ImuSample{at(t), at(t), twist_base.tail<3>(), {1e-6 * t_s, 0, 9.81}, {}});
    }
  }

  /// Estimate at 1 s, facing along +y of odom, on the true path except for its start.
  [[nodiscard]] FastSample estimate() const {
    FastSample sample;
    sample.stamp = at(milliseconds{1000});
    sample.T_odom_base = {so3_exp({0, 0, 90 * kRadPerDeg}), {2, 3, 0.5}};
    sample.twist_base = twist_base_;
    return sample;
  }

  [[nodiscard]] FastSample carried(const FastSample& estimate, Duration now) const {
    FastOdometry fast;
    fast.set_estimate(estimate);
    const std::optional<FastSample> sample = fast.predict(sources_, SourceId{1}, at(now));
    EXPECT_TRUE(sample);
    return sample.value_or(FastSample{});
  }

 private:
  Vector6 twist_base_;
  MotionSources sources_{{{"wheels", SourceKind::odometry, {}}, {"imu", SourceKind::imu, {}}}, Fusion::combined};
};

/// Expects the constant twist to be extrapolated from the estimate.
void expect_on_arc(const ArcDrive& drive, Duration now) {
  const FastSample from = drive.estimate();
  const FastSample sample = drive.carried(from, now);
  const double elapsed_s = to_seconds(at(now) - from.stamp);
  const Pose expected = from.T_odom_base * se3_exp(elapsed_s * from.twist_base);
  EXPECT_EQ(sample.stamp, at(now));
  EXPECT_LT((sample.T_odom_base.translation - expected.translation).norm(), 1e-9);
  EXPECT_LT((sample.T_odom_base.R() - expected.R()).norm(), 1e-9);
  EXPECT_LT((sample.twist_base - from.twist_base).norm(), 1e-9);
}

/// Regression: the pose was extrapolated in a straight line, 4.5 mm off this arc.
TEST(FastOdometry, GyroAlonePropagatesAlongAnArcAtTheSpeedOfTheEstimate) {
  expect_on_arc(ArcDrive(turning(), milliseconds{1100}, milliseconds{-1}), milliseconds{1100});
}

/// The wheels' track is extrapolated in a straight line from their last sample, here 15 ms before that of the gyro.
TEST(FastOdometry, ArcContinuesBeyondTheLastWheelSample) {
  expect_on_arc(ArcDrive(turning(), milliseconds{1095}, milliseconds{1080}), milliseconds{1095});
}

TEST(FastOdometry, WheelSamplesBeforeTheEstimateGiveTheSpeed) {
  expect_on_arc(ArcDrive(turning(), milliseconds{1015}, milliseconds{980}), milliseconds{1015});
}

TEST(FastOdometry, SpeedVarianceGrowsAlongTheHeading) {
  const ArcDrive drive(straight_on(), milliseconds{1100}, milliseconds{-1});
  FastSample from = drive.estimate();
  from.twist_covariance(0, 0) = 0.04; // forward
  from.twist_covariance(1, 1) = 0.01; // lateral
  const Matrix6 covariance = drive.carried(from, milliseconds{1100}).pose_covariance;
  EXPECT_NEAR(covariance(1, 1), 0.01 * 0.04, 1e-12) << "it heads along +y";
  EXPECT_NEAR(covariance(0, 0), 0.01 * 0.01, 1e-12);
}

TEST(FastOdometry, HeadingVarianceOfTheEstimateAddsLateralVariance) {
  const ArcDrive drive(straight_on(), milliseconds{1100}, milliseconds{-1});
  FastSample from = drive.estimate();
  from.pose_covariance(5, 5) = 1e-4;
  const Matrix6 covariance = drive.carried(from, milliseconds{1100}).pose_covariance;
  const double moved_m = 0.1 * kSpeed_mps; // along +y: a left turn moves it towards -x
  EXPECT_NEAR(covariance(0, 0), moved_m * moved_m * 1e-4, 1e-12);
  EXPECT_NEAR(covariance(0, 5), -moved_m * 1e-4, 1e-12);
  EXPECT_NEAR(covariance(1, 1), 0.0, 1e-12);
  EXPECT_NEAR(covariance(5, 5), 1e-4, 1e-12);
}

/// Compares each twist error alone with its effect on the exact motion.
TEST(FastOdometry, TwistCovariancePropagatesToThePose) {
  constexpr double kError = 1e-6;
  constexpr double kElapsed_s = 0.1;
  const ArcDrive drive(turning(), milliseconds{1100}, milliseconds{-1});
  FastSample from = drive.estimate();
  const Pose T_odom_now = from.T_odom_base * se3_exp(kElapsed_s * turning());
  for (int axis = 0; axis < 6; ++axis) {
    Vector6 other = turning();
    other[axis] += kError;
    const Vector6 effect = difference(from.T_odom_base * se3_exp(kElapsed_s * other), T_odom_now) / kError;
    from.twist_covariance.setZero();
    from.twist_covariance(axis, axis) = 1;
    const Matrix6 covariance = drive.carried(from, milliseconds{1100}).pose_covariance;
    EXPECT_LT((covariance - effect * effect.transpose()).norm(), 1e-3 * covariance.norm()) << axis;
  }
}

TEST(FastOdometry, PredictsNothingBeforeTheFirstEstimateOrForOtherSources) {
  const MotionSources none({{"imu", SourceKind::imu, {}}}, Fusion::combined);
  FastOdometry fast;
  EXPECT_FALSE(fast.predict(none, SourceId{0}, at(milliseconds{1}))) << "no estimate";
  fast.set_estimate(FastSample{});
  EXPECT_FALSE(fast.predict(none, SourceId{0}, at(milliseconds{1}))) << "no sample";
}

} // namespace
} // namespace locus::daemon
