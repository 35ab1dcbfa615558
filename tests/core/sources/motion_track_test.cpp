// SPDX-License-Identifier: Apache-2.0
#include "core/sources/motion_track.hpp"

#include <numbers>

#include <gtest/gtest.h>

#include "core/stamps.hpp"

namespace locus {
namespace {

using std::chrono::milliseconds;

MotionTrack odometry_track() {
  return MotionTrack({.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}});
}
MotionTrack imu_track(const Pose& T_base_source = {}) {
  return MotionTrack({.name = "imu", .kind = SourceKind::imu, .T_base_source = T_base_source});
}

OdometrySample odometry(Stamp stamp, double x_m, double yaw_rad = 0.0) {
  return {.stamp = stamp, .arrival = stamp, .T_source_base = {so3_exp({0, 0, yaw_rad}), {x_m, 0, 0}}};
}

ImuSample imu(Stamp stamp, const Eigen::Vector3d& angular_velocity_radps,
              const Eigen::Vector3d& specific_force_mps2 = {0, 0, 9.81}) {
  return {.stamp = stamp,
          .arrival = stamp,
          .angular_velocity_radps = angular_velocity_radps,
          .specific_force_mps2 = specific_force_mps2,
          .attitude = {}};
}

TEST(MotionTrack, PosesBetweenSamplesAreInterpolated) {
  MotionTrack track = odometry_track();
  track.add(odometry(at_ms(0), 1.0, 0.0));
  track.add(odometry(at_ms(100), 2.0, 0.4));
  const auto T = track.at(at_ms(25));
  ASSERT_TRUE(T);
  EXPECT_NEAR(T->translation.x(), 1.25, 1e-12);
  EXPECT_NEAR(so3_log(T->rotation).z(), 0.1, 1e-12);
}

/// Two poses 2 cm and 0.1 ms apart would mean 200 m/s.
TEST(MotionTrack, StampJitterMakesNoVelocity) {
  MotionTrack track = odometry_track();
  for (int i = 0; i < 5; ++i)
    track.add(odometry(at_ms(20 * i), 0.02 * i));
  track.add(odometry(at_ms(80) + std::chrono::microseconds{100}, 0.1));
  EXPECT_NEAR(track.at(at_ms(120))->translation.x(), 0.12, 0.1);
  MotionTrack young = odometry_track();
  young.add(odometry(at_ms(0), 0.0));
  young.add(odometry(at_ms(1), 1.0));
  EXPECT_EQ(young.at(at_ms(40))->translation.x(), 1.0) << "nothing is known of its velocity";
}

TEST(MotionTrack, BeforeTheOldestSampleThereIsNothing) {
  MotionTrack track = odometry_track();
  EXPECT_FALSE(track.at(at_ms(0)));
  track.add(odometry(at_ms(0), 1.0));
  EXPECT_FALSE(track.at(at_ms(-1)));
  EXPECT_TRUE(track.at(at_ms(0)));
}

TEST(MotionTrack, ExtrapolatesForFiftyMillisecondsAndNoFarther) {
  MotionTrack track = odometry_track();
  track.add(odometry(at_ms(0), 0.0));
  track.add(odometry(at_ms(100), 1.0));
  EXPECT_NEAR(track.at(at_ms(130))->translation.x(), 1.3, 1e-12);
  EXPECT_NEAR(track.at(at_ms(150))->translation.x(), 1.5, 1e-12);
  EXPECT_FALSE(track.at(at_ms(151)));
}

TEST(MotionTrack, LatenessIsCompensated) {
  MotionTrack track = imu_track();
  for (int i = 0; i <= 20; ++i)
    track.add(imu(at_ms(10 * i), {0, 0, 0.1 * i}, {0.01 * i, 0, 9.81}));
  const Pose before = *track.at(at_ms(100));
  const SpecificForce force = *track.specific_force(at_ms(50), at_ms(100));
  track.set_late(milliseconds{40});
  EXPECT_EQ(track.at(at_ms(60)), before);
  EXPECT_EQ(track.specific_force(at_ms(10), at_ms(60))->mean_base_mps2(), force.mean_base_mps2());
  EXPECT_EQ(track.newest(), at_ms(160));
  EXPECT_TRUE(track.is_live(at_ms(210)));
  EXPECT_FALSE(track.is_live(at_ms(211)));
  EXPECT_TRUE(track.has_sample_in(at_ms(150), at_ms(160)));
  EXPECT_FALSE(track.has_sample_in(at_ms(160), at_ms(200)));
  EXPECT_FALSE(track.at(at_ms(211)));
}

TEST(MotionTrack, SingleSampleHasNoMotion) {
  MotionTrack track = odometry_track();
  track.add(odometry(at_ms(0), 7.0));
  EXPECT_EQ(track.at(at_ms(40))->translation.x(), 7.0);
}

TEST(MotionTrack, ClearedTrackRestarts) {
  MotionTrack track = odometry_track();
  track.add(odometry(at_ms(0), 0.0));
  track.add(odometry(at_ms(20), 1.0));
  track.clear();
  EXPECT_FALSE(track.at(at_ms(20)));
  track.add(odometry(at_ms(40), 9.0));
  EXPECT_FALSE(track.at(at_ms(30)));
  EXPECT_EQ(track.at(at_ms(50))->translation.x(), 9.0);
}

TEST(MotionTrack, FullRingDropsTheOldest) {
  MotionTrack track = odometry_track();
  const int samples = static_cast<int>(MotionTrack::kCapacity) + 10;
  for (int i = 0; i < samples; ++i)
    track.add(odometry(at_ms(i), i));
  EXPECT_FALSE(track.at(at_ms(9)));
  for (int i = 10; i < samples; ++i)
    ASSERT_NEAR(track.at(at_ms(i))->translation.x(), i, 1e-12);
}

TEST(MotionTrack, TheGyroIsIntegratedInTheFrameOfTheBase) {
  // The unit lies on its side: its x axis is the base's z axis.
  const Pose T_base_imu{Eigen::Quaterniond{Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitY())},
                        {0.3, 0, 0.1}};
  ASSERT_LT((T_base_imu.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  MotionTrack track = imu_track(T_base_imu);
  for (int ms = 0; ms <= 500; ms += 5)
    track.add(imu(at_ms(ms), {2.0, 0, 0}, {9.81, 0, 0}));
  const Pose T = track.at(at_ms(0))->inverse() * *track.at(at_ms(500));
  EXPECT_LT((so3_log(T.rotation) - Eigen::Vector3d{0, 0, 1.0}).norm(), 1e-9);
  EXPECT_EQ(T.translation.norm(), 0.0) << "an inertial source turns, it does not move";
  const auto force = track.specific_force(at_ms(100), at_ms(200));
  ASSERT_TRUE(force);
  EXPECT_LT((force->early_base_mps2 - Eigen::Vector3d{0, 0, 9.81}).norm(), 1e-9);
  EXPECT_LT((force->late_base_mps2 - Eigen::Vector3d{0, 0, 9.81}).norm(), 1e-9);
}

TEST(MotionTrack, GrowingForceHasALargerLatePart) {
  MotionTrack track = imu_track();
  for (int ms = 0; ms <= 200; ++ms)
    track.add(imu(at_ms(ms), {0, 0, 0}, {1e-2 * ms, 0, 9.81}));
  const auto force = track.specific_force(at_ms(100), at_ms(200));
  ASSERT_TRUE(force);
  EXPECT_NEAR(force->mean_base_mps2().x(), 1.5, 0.01);
  EXPECT_NEAR(force->late_base_mps2.x(), 1.0 + 2.0 / 3.0, 0.01) << "mean of a ramp, weighted by the time";
  EXPECT_NEAR(force->early_base_mps2.x(), 1.0 + 1.0 / 3.0, 0.01);
}

TEST(MotionTrack, SingleForceSampleIsBothEarlyAndLate) {
  MotionTrack track = imu_track();
  track.add(imu(at_ms(200), {0, 0, 0}, {1.0, 0, 9.81}));
  const auto force = track.specific_force(at_ms(100), at_ms(200));
  ASSERT_TRUE(force);
  EXPECT_TRUE(force->early_base_mps2.isApprox(force->late_base_mps2, 1e-12));
  EXPECT_NEAR(force->late_base_mps2.x(), 1.0, 1e-12);
}

/// Regression: the mean over the samples inside the sweep was shifted by half a period.
TEST(MotionTrack, TheForceOfASlowUnitIsIntegratedOverExactlyTheSweep) {
  MotionTrack track = imu_track();
  for (int ms = 30; ms <= 330; ms += 50)
    track.add(imu(at_ms(ms), {0, 0, 0}, {0.01 * ms, 0, 9.81}));
  const auto force = track.specific_force(at_ms(100), at_ms(200));
  ASSERT_TRUE(force);
  EXPECT_NEAR(force->mean_base_mps2().x(), 1.5, 1e-9);
  EXPECT_NEAR(force->late_base_mps2.x(), 1.0 + 2.0 / 3.0, 1e-9);
  EXPECT_LT(force->noise_per_s.norm(), 1e-9) << "a steady change is no noise";
}

TEST(MotionTrack, TheNoiseOfAForceIsMeasured) {
  MotionTrack track = imu_track();
  for (int i = 0; i <= 100; ++i) // 1.5 m/s^2 alternating at 100 Hz, with second differences of 6 m/s^2
    track.add(imu(at_ms(10 * i), {0, 0, 0}, {i % 2 == 0 ? 1.5 : -1.5, 0, 9.81}));
  const auto force = track.specific_force(at_ms(900), at_ms(1000));
  ASSERT_TRUE(force);
  EXPECT_NEAR(force->noise_per_s.x(), 0.01 * 36.0 / 6.0, 1e-9);
  EXPECT_LT(force->noise_per_s.tail<2>().norm(), 1e-12);
}

TEST(MotionTrack, AttitudeGivesUpInTheBaseFrame) {
  MotionTrack track = imu_track({from_rpy_rad({0, 0, std::numbers::pi / 2}), {0, 0, 0}});
  ImuSample sample;
  sample.stamp = sample.arrival = at_ms(10);
  sample.attitude = from_rpy_rad({0.1, 0, 1.0}); // roll of the unit is pitch of the base
  track.add(sample);
  const auto up = track.up_base(at_ms(0), at_ms(20));
  ASSERT_TRUE(up);
  EXPECT_LT((*up - Eigen::Vector3d(-std::sin(0.1), 0, std::cos(0.1))).norm(), 1e-9);
  EXPECT_FALSE(track.up_base(at_ms(20), at_ms(30))) << "no sample";
  sample.stamp = sample.arrival = at_ms(25);
  sample.attitude.reset();
  track.add(sample);
  EXPECT_FALSE(track.up_base(at_ms(20), at_ms(30))) << "a sample without attitude";
}

TEST(MotionTrack, AChangingTurnRateIsIntegratedByTrapezoids) {
  MotionTrack track = imu_track();
  for (int ms = 0; ms <= 1000; ms += 10)
    track.add(imu(at_ms(ms), {0, 0, 1e-3 * ms}));
  EXPECT_NEAR(so3_log(track.at(at_ms(0))->rotation.conjugate() * track.at(at_ms(1000))->rotation).z(), 0.5, 1e-9);
}

TEST(MotionTrack, ReportsWhetherASampleLiesInAWindow) {
  MotionTrack track = odometry_track();
  EXPECT_FALSE(track.has_sample_in(at_ms(-100), at_ms(100)));
  track.add(odometry(at_ms(0), 0.0));
  track.add(odometry(at_ms(100), 0.0));
  EXPECT_TRUE(track.has_sample_in(at_ms(50), at_ms(100)));
  EXPECT_FALSE(track.has_sample_in(at_ms(100), at_ms(200))) << "the window is open at its beginning";
  EXPECT_TRUE(track.has_sample_in(at_ms(-1), at_ms(99)));
  EXPECT_FALSE(track.has_sample_in(at_ms(10), at_ms(99)));
  EXPECT_FALSE(track.has_sample_in(at_ms(-50), at_ms(-1)));
}

TEST(MotionTrack, OdometryHasNoSpecificForce) {
  MotionTrack track = odometry_track();
  track.add(odometry(at_ms(0), 0.0));
  EXPECT_FALSE(track.specific_force(at_ms(-10), at_ms(10)));
}

} // namespace
} // namespace locus
