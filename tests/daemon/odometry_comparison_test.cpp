// SPDX-License-Identifier: Apache-2.0
#include "daemon/odometry_comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <utility>

#include <gtest/gtest.h>

namespace locus::daemon {
namespace {

constexpr double kSigmas = 4.0;

/// Speed ahead (m/s) and yaw rate (rad/s) of a robot on wheels.
struct Speed {
  double ahead_mps, yaw_radps;
};
using Course = std::function<Speed(double t_s)>;

Speed winding(double t) { return {1.0 + 0.5 * std::sin(0.7 * t), 0.8 * std::sin(0.9 * t)}; }
Speed straight(double /*t*/) { return {1.0, 0.0}; }
Speed at_rest(double /*t*/) { return {0.0, 0.0}; }

struct Errors {
  double late_s = 0.0, scale = 1.0, yaw_scale = 1.0;
  Eigen::Vector3d lidar_turn_rad = Eigen::Vector3d::Zero();
  double offset_m = 0.0;   ///< of the point that the odometry reports, ahead
  double slip_share = 0.0; ///< of the time
};

/// Integrates a course, as the odometry reports it.
class Wheels {
 public:
  explicit Wheels(Course course) : course_(std::move(course)) {}
  /// Returns the pose at a later time than before.
  const Pose& at(double t_s, const Errors& errors = {}, bool slips = false) {
    constexpr double kStep_s = 0.01;
    while (t_s_ < t_s - 1e-9) {
      const double step_s = std::min(kStep_s, t_s - t_s_);
      const auto [ahead_mps, yaw_radps] = course_(t_s_ + 0.5 * step_s);
      Vector6 step = Vector6::Zero();
      step[0] = step_s * errors.scale * ahead_mps * (slips ? 1.6 : 1.0);
      step[1] = step_s * errors.offset_m * yaw_radps;
      step[5] = step_s * errors.yaw_scale * yaw_radps;
      T_ = T_ * se3_exp(step);
      t_s_ += step_s;
    }
    return T_;
  }

 private:
  Course course_;
  Pose T_;
  double t_s_ = -1.0;
};

OdometryFindings drive(const Course& course, const Errors& errors, unsigned seed, double duration_s = 60.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double translation, double rotation) {
    Vector6 twist;
    for (int i = 0; i < 6; ++i)
      twist[i] = (i < 3 ? translation : rotation) * normal(random);
    return twist;
  };
  Wheels wheels(course), truth(course);
  Pose T_truth, T_wheels, T_reported;
  OdometryComparison comparison;
  const Eigen::Vector3d lasers_rad = 0.1 * kRadPerDeg * Eigen::Vector3d{normal(random), normal(random), normal(random)};
  const Matrix6 to_lidar = turn_both(so3_exp(-errors.lidar_turn_rad - lasers_rad));
  bool slips = false;
  for (int i = 1; i < static_cast<int>(10 * duration_s); ++i) {
    const double t_s = 0.1 * i;
    if (i % 10 == 0)
      slips = std::uniform_real_distribution<double>()(random) < errors.slip_share;
    const Pose T_now = truth.at(t_s);
    const Vector6 twist = se3_log(T_truth.inverse() * T_now) / 0.1;
    T_truth = T_now;
    const Pose T_wheels_now = wheels.at(t_s - errors.late_s, errors, slips);
    T_reported = T_reported * (T_wheels.inverse() * T_wheels_now) * se3_exp(noise(0.002, 0.001));
    T_wheels = T_wheels_now;
    comparison.add(Stamp{} + from_seconds(t_s), T_reported, to_lidar * twist + noise(0.01, 0.004));
  }
  return comparison.findings();
}

TEST(OdometryComparison, DeterminesTheLatenessOfAnOdometry) {
  for (const double late_s : {-0.04, 0.0, 0.02, 0.1})
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const Learned found = drive(winding, {.late_s = late_s, .scale = 1.03, .yaw_scale = 0.85}, seed).late_s;
      EXPECT_NEAR(found.mean, late_s, kSigmas * found.sigma) << "seed " << seed;
      EXPECT_NEAR(found.mean, late_s, 0.005 + 0.1 * std::abs(late_s)) << "seed " << seed;
      EXPECT_LT(found.sigma, 0.005 + 0.3 * std::abs(late_s));
    }
}

TEST(OdometryComparison, DeterminesTheYawScale) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Learned found = drive(winding, {.late_s = 0.02, .yaw_scale = 0.85}, seed).yaw_scale;
    EXPECT_NEAR(found.mean, -0.15, kSigmas * found.sigma) << "seed " << seed;
    EXPECT_LT(found.sigma, 0.02) << "seed " << seed;
  }
}

TEST(OdometryComparison, DeterminesTheRotationOfTheLidars) {
  const Eigen::Vector3d turn_rad = kRadPerDeg * Eigen::Vector3d{-3.0, 4.0, 2.0};
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto found = drive(winding, {.lidar_turn_rad = turn_rad, .offset_m = 0.1}, seed).lidar_turn_rad;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double expected = turn_rad[static_cast<Eigen::Index>(axis)];
      EXPECT_NEAR(found[axis].mean, expected, 0.5 * kRadPerDeg) << "seed " << seed << ", axis " << axis;
      EXPECT_LT(found[axis].sigma, 0.3 * kRadPerDeg) << "seed " << seed << ", axis " << axis;
    }
  }
}

/// Straight ahead nothing determines a lateness or the roll of a lidar, but its pitch makes it climb.
TEST(OdometryComparison, StraightDriveDeterminesNeitherLatenessNorRoll) {
  const Errors errors{.late_s = 0.08, .lidar_turn_rad = kRadPerDeg * Eigen::Vector3d{4.0, 4.0, 0.0}};
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    const OdometryFindings found = drive(straight, errors, seed, 20.0);
    ASSERT_EQ(found.late_s.mean, 0.0) << "seed " << seed;
    ASSERT_NEAR(found.late_s.sigma, OdometryFindings::kPriorLate_s, 1e-9);
    ASSERT_LT(std::abs(found.lidar_turn_rad[0].mean), OdometryFindings::kPriorTurn_rad) << "seed " << seed;
    ASSERT_GT(found.lidar_turn_rad[0].sigma, 0.7 * OdometryFindings::kPriorTurn_rad);
    ASSERT_NEAR(found.lidar_turn_rad[1].mean, 4.0 * kRadPerDeg, 0.8 * kRadPerDeg) << "seed " << seed;
  }
}

TEST(OdometryComparison, RestDeterminesNothing) {
  const OdometryFindings found = drive(at_rest, {.late_s = 0.08, .lidar_turn_rad = {0.05, 0.05, 0.05}}, 1);
  EXPECT_EQ(found.late_s.mean, 0.0);
  EXPECT_NEAR(found.late_s.sigma, OdometryFindings::kPriorLate_s, 1e-9);
  for (const Learned& turn : found.lidar_turn_rad)
    EXPECT_EQ(turn.mean, 0.0);
}

/// A circle does not tell an offset of the odometry's point from a yaw of the lidar.
TEST(OdometryComparison, CircleDoesNotDetermineTheYawOfTheLidars) {
  const auto circle = [](double) { return Speed{1.0, 0.5}; };
  const Learned yaw = drive(circle, {.offset_m = 0.15}, 1).lidar_turn_rad[2];
  EXPECT_NEAR(yaw.mean, 0.0, kSigmas * yaw.sigma);
  EXPECT_GT(yaw.sigma, 1.0 * kRadPerDeg);
}

TEST(OdometryComparison, ErrorsAreConsistentWithTheirDeviations) {
  constexpr int kDrives = 200;
  std::array<double, 4> nees{};
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (unsigned seed = 1; seed <= kDrives; ++seed) {
    const Errors errors{.late_s = 0.01 * normal(random),
                        .lidar_turn_rad = kRadPerDeg * Eigen::Vector3d{normal(random), normal(random), normal(random)}};
    const OdometryFindings found = drive(winding, errors, seed);
    const auto squared = [](const Learned& figure, double truth) {
      return (figure.mean - truth) * (figure.mean - truth) / (figure.sigma * figure.sigma);
    };
    nees[3] += squared(found.late_s, errors.late_s) / kDrives;
    for (std::size_t axis = 0; axis < 3; ++axis)
      nees[axis] +=
          squared(found.lidar_turn_rad[axis], errors.lidar_turn_rad[static_cast<Eigen::Index>(axis)]) / kDrives;
  }
  for (std::size_t i = 0; i < nees.size(); ++i) {
    EXPECT_GT(nees[i], 0.5) << (i < 3 ? "rotation about axis " : "lateness ") << i;
    EXPECT_LT(nees[i], 2.0) << (i < 3 ? "rotation about axis " : "lateness ") << i;
  }
}

TEST(OdometryComparison, SlipsOfWheelsAreNeitherLatenessNorRotation) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const OdometryFindings found = drive(winding, {.slip_share = 0.1}, seed);
    EXPECT_NEAR(found.late_s.mean, 0.0, kSigmas * found.late_s.sigma + 0.001) << "seed " << seed;
    EXPECT_LT(std::abs(found.late_s.mean), 0.01) << "seed " << seed;
    for (const Learned& turn : found.lidar_turn_rad)
      EXPECT_LT(std::abs(turn.mean), 0.3 * kRadPerDeg) << "seed " << seed;
  }
}

TEST(OdometryComparison, HoursOfDrivingRefineTheResult) {
  const Errors errors{.late_s = 0.02, .lidar_turn_rad = {0.0, 0.02, 0.0}};
  const OdometryFindings minute = drive(winding, errors, 1), hour = drive(winding, errors, 1, 3600.0);
  EXPECT_LE(hour.lidar_turn_rad[1].sigma, minute.lidar_turn_rad[1].sigma);
  EXPECT_NEAR(hour.lidar_turn_rad[1].mean, 0.02, kSigmas * hour.lidar_turn_rad[1].sigma);
  EXPECT_NEAR(hour.late_s.mean, 0.02, 0.003);
}

TEST(OdometryComparison, GapsAndInvalidPosesAreNotCompared) {
  OdometryComparison comparison;
  Vector6 ahead = Vector6::Zero();
  ahead[0] = 1.0;
  for (int i = 0; i < 1000; ++i) {
    const Pose T{Eigen::Quaterniond::Identity(),
                 {i % 2 == 0 ? 1e3 : -1e3, 0.0, i % 5 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1.0}};
    comparison.add(Stamp{} + i * std::chrono::seconds{1}, T, ahead);
    comparison.add(Stamp{} + i * std::chrono::seconds{1}, T, ahead); // same stamp
  }
  const OdometryFindings found = comparison.findings();
  EXPECT_EQ(found.late_s.mean, 0.0);
  EXPECT_EQ(found.lidar_turn_rad[1].mean, 0.0);
}

} // namespace
} // namespace locus::daemon
