// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gravity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace locus {
namespace {

using std::chrono::milliseconds;

constexpr Duration kPeriod = milliseconds{100};
const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

/// A sweep of a base with this roll, pitch and acceleration.
Sweep sweep_with(const Eigen::Vector3d& rpy_deg, const Eigen::Vector3d& acceleration_base_mps2 = {0, 0, 0}) {
  Sweep sweep;
  sweep.end = sweep.start + kPeriod;
  const Eigen::Vector3d force =
      from_rpy_rad(rpy_deg * kRadPerDeg).conjugate() * (9.80665 * kUp) + acceleration_base_mps2;
  sweep.motion.specific_force = SpecificForce{force, force};
  return sweep;
}

double tilt_deg(const Gravity& gravity) { return std::acos(std::min(1.0, gravity.up_base()->z())) / kRadPerDeg; }

const Eigen::Quaterniond kNoTurn = Eigen::Quaterniond::Identity();

TEST(Gravity, IsKnownAtOnceAtRest) {
  Gravity gravity;
  gravity.observe(kNoTurn, sweep_with({5, -3, 0}));
  ASSERT_TRUE(gravity.up_base());
  EXPECT_LT((level_rpy_rad(*gravity.up_base()) - Eigen::Vector3d(5, -3, 0) * kRadPerDeg).norm(), 1e-9);
}

TEST(Gravity, OneSecondOfAccelerationHardlyTilts) {
  Gravity gravity;
  gravity.observe(kNoTurn, sweep_with({0, 0, 0}));
  for (int i = 0; i < 10; ++i)
    gravity.observe(kNoTurn, sweep_with({0, 0, 0}, {0.8, 0, 0})); // equivalent to 4.7 deg of tilt
  EXPECT_LT(tilt_deg(gravity), 1.5);
}

TEST(Gravity, GyroDetectsARampAtOnce) {
  Gravity gravity;
  gravity.observe(kNoTurn, sweep_with({0, 0, 0}));
  double pitch_deg = 0;
  for (int i = 0; i < 5; ++i) {
    pitch_deg -= 2;
    gravity.observe(from_rpy_rad({0, -2 * kRadPerDeg, 0}), sweep_with({0, pitch_deg, 0}));
  }
  EXPECT_NEAR(tilt_deg(gravity), 10.0, 0.01);
}

TEST(Gravity, GyroDriftIsCorrected) {
  Gravity gravity;
  gravity.observe(kNoTurn, sweep_with({0, 0, 0}));
  for (int i = 0; i < 300; ++i)
    gravity.observe(from_rpy_rad({0.001 * kRadPerDeg, 0, 0}), sweep_with({0, 0, 0}));
  EXPECT_LT(tilt_deg(gravity), 0.05);
}

TEST(Gravity, ForcesUnlikeGravityAreIgnored) {
  Gravity gravity;
  gravity.observe(kNoTurn, sweep_with({0, 0, 0}, {6, 0, 0}));
  EXPECT_FALSE(gravity.up_base());
  gravity.observe(kNoTurn, sweep_with({1, 0, 0}));
  EXPECT_NEAR(tilt_deg(gravity), 1.0, 1e-6);
  gravity.observe(kNoTurn, Sweep{});
  EXPECT_FALSE(gravity.up_base()) << "no inertial sensor was heard";
}

TEST(Gravity, AnAttitudeIsPreferredToTheAccelerometer) {
  Gravity gravity;
  Sweep sweep = sweep_with({0, 0, 0}, {0.8, 0, 0});
  sweep.motion.up_base = from_rpy_rad({0, 2 * kRadPerDeg, 0}).conjugate() * kUp;
  gravity.observe(kNoTurn, sweep);
  EXPECT_NEAR(tilt_deg(gravity), 2.0, 1e-9);
}

// --- Tilt -------------------------------------------------------------------------------------------------------

/// Inserts a keyframe every ten sweeps. Returns the remaining tilt.
double tilt_after(int sweeps, double tilt_rad, double up_noise_rad = 0.0) {
  TiltKeeper keeper;
  Eigen::Quaterniond R_odom_base = from_rpy_rad({tilt_rad, 0, 0.7}); // the true base is level
  for (int i = 0; i < sweeps; ++i) {
    const double noise = i % 2 == 0 ? up_noise_rad : -up_noise_rad;
    keeper.observe(R_odom_base, from_rpy_rad({noise, 0, 0}).conjugate() * kUp);
    if (i % 10 == 9)
      R_odom_base = so3_exp(keeper.pop_correction_rad()) * R_odom_base;
  }
  return std::acos((R_odom_base * kUp).z());
}

TEST(TiltKeeper, CorrectsDriftTowardsGravity) {
  EXPECT_LT(tilt_after(10'000, 3 * kRadPerDeg), 1.1 * kRadPerDeg);
  EXPECT_GT(tilt_after(10'000, 3 * kRadPerDeg), 0.8 * kRadPerDeg) << "and no farther";
}

TEST(TiltKeeper, CorrectionPerKeyframeIsLimited) {
  EXPECT_GT(tilt_after(1000, 3 * kRadPerDeg), (3 - 100 * 0.02) * kRadPerDeg);
}

TEST(TiltKeeper, LevelOdometryIsUnchanged) {
  EXPECT_NEAR(tilt_after(1000, 0.5 * kRadPerDeg, 0.02), 0.5 * kRadPerDeg, 1e-9);
}

TEST(TiltKeeper, ShockIsNotDrift) { EXPECT_NEAR(tilt_after(1000, 8 * kRadPerDeg), 8 * kRadPerDeg, 1e-9); }

} // namespace
} // namespace locus
