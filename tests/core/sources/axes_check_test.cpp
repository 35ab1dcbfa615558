// SPDX-License-Identifier: Apache-2.0
#include "core/sources/axes_check.hpp"

#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "core/base/pose.hpp"

namespace locus {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSweep_s = 0.1;

/// Integrated turns (rad) of a robot about the axes of its base, at a time (s).
using Turned = Vector3d (*)(double time_s);

/// A gait of 2 Hz that pitches with each of its two steps, while the robot turns left and right.
Vector3d walk(double time_s) {
  const double phase = 2.0 * std::numbers::pi * 2.0 * time_s;
  return {0.03 * std::cos(phase), 0.02 * std::sin(2.0 * phase), 0.8 * std::sin(0.6 * time_s)};
}

/// A gait whose pitch lags its roll by a quarter of a period.
Vector3d waddle(double time_s) {
  const double phase = 2.0 * std::numbers::pi * 2.0 * time_s;
  return {0.03 * std::cos(phase), 0.03 * std::sin(phase), 0.8 * std::sin(0.6 * time_s)};
}

/// Slopes, along which no sweep turns by more than noise.
Vector3d roll_over_slopes(double time_s) {
  return {0.07 * std::sin(0.6 * time_s), 0.09 * std::sin(0.45 * time_s), 0.13 * std::sin(0.3 * time_s)};
}

Vector3d turn_on_level_ground(double time_s) { return {0.0, 0.0, 0.8 * std::sin(0.6 * time_s)}; }

/// A robot at rest whose engine shakes it by 0.1 degrees.
Vector3d vibrate(double time_s) {
  const double phase = 2.0 * std::numbers::pi * 13.0 * time_s;
  return {0.001 * std::cos(phase), 0.001 * std::sin(1.3 * phase), 0.0};
}

/// A gyro whose axes are `R_gyro_base`, with stamps that are `late_s` late, beside lidar; both with noise.
class Comparison {
 public:
  Comparison(Turned turned, const Matrix3d& R_gyro_base, double late_s = 0.0, double noise_deg = 0.2)
      : turned_(turned), R_gyro_base_(R_gyro_base), late_s_(late_s), noise_(0.0, noise_deg * kRadPerDeg) {}

  void drive(double duration_s) {
    for (double time_s = 0.0; time_s < duration_s; time_s += kSweep_s) {
      AxesCheck::GyroTurns gyro_rad;
      for (std::size_t i = 0; i < gyro_rad.size(); ++i)
        gyro_rad[i] = R_gyro_base_ * turn(time_s + to_seconds(AxesCheck::late(i)) - late_s_) + noise();
      const Vector3d lidar_rad = turn(time_s) + noise();
      check.add(lidar_rad, gyro_rad, kSweep_s);
    }
  }

  AxesCheck check;

 private:
  [[nodiscard]] Vector3d turn(double from_s) const { return turned_(from_s + kSweep_s) - turned_(from_s); }
  Vector3d noise() { return {noise_(random_), noise_(random_), noise_(random_)}; }

  Turned turned_;
  Matrix3d R_gyro_base_;
  double late_s_;
  std::mt19937 random_{7};
  std::normal_distribution<double> noise_;
};

Matrix3d turned_by(const Vector3d& rpy_deg) { return from_rpy_rad(kRadPerDeg * rpy_deg).toRotationMatrix(); }

TEST(AxesCheck, SoundGyroIsNotWrong) {
  Comparison sound(walk, Matrix3d::Identity());
  sound.drive(600.0);
  EXPECT_FALSE(sound.check.is_wrong());
  EXPECT_FALSE(sound.check.axes());
  EXPECT_FALSE(sound.check.is_in_degrees());
}

TEST(AxesCheck, QuarterAndHalfTurnsAreFound) {
  for (const Vector3d& rpy_deg : {Vector3d{0, 0, 90}, Vector3d{0, 0, -90}, Vector3d{0, 0, 180}, Vector3d{180, 0, 0},
                                  Vector3d{0, 90, 0}, Vector3d{90, 0, 90}}) {
    SCOPED_TRACE(rpy_deg.transpose());
    Comparison turned(walk, turned_by(rpy_deg));
    turned.drive(15.0);
    EXPECT_TRUE(turned.check.is_wrong());
    ASSERT_TRUE(turned.check.axes());
    EXPECT_TRUE(turned.check.axes()->isApprox(turned_by(rpy_deg).transpose(), 1e-9)) << *turned.check.axes();
  }
}

TEST(AxesCheck, ReversedAxisIsFoundAsMirrored) {
  const Matrix3d reversed = Vector3d{1, -1, 1}.asDiagonal();
  Comparison mirrored(walk, reversed);
  mirrored.drive(15.0);
  ASSERT_TRUE(mirrored.check.axes());
  EXPECT_TRUE(mirrored.check.axes()->isApprox(reversed)) << *mirrored.check.axes();
}

TEST(AxesCheck, MountingErrorOfSomeDegreesIsNotWrong) {
  for (const Vector3d& rpy_deg : {Vector3d{20, 0, 0}, Vector3d{0, 0, 30}, Vector3d{15, -15, 15}}) {
    Comparison misaligned(walk, turned_by(rpy_deg));
    misaligned.drive(120.0);
    EXPECT_FALSE(misaligned.check.is_wrong()) << rpy_deg.transpose();
  }
}

TEST(AxesCheck, TurnsAboutOneAxisDoNotDetermineTheOthers) {
  Comparison about_z(turn_on_level_ground, turned_by({0, 0, 90}));
  about_z.drive(600.0);
  EXPECT_FALSE(about_z.check.is_wrong());
  Comparison upside_down(turn_on_level_ground, turned_by({180, 0, 0}));
  upside_down.drive(60.0);
  EXPECT_TRUE(upside_down.check.is_wrong());
  EXPECT_FALSE(upside_down.check.axes()) << "a half turn about y would measure the same";
}

/// A delay of a quarter of a period looks like an exchange of roll and pitch, one of half like a reversal.
TEST(AxesCheck, LateStampsAreNoExchangeOfAxes) {
  for (const double late_s : {-0.25, -0.125, -0.07, 0.03, 0.07, 0.125, 0.18, 0.25}) {
    for (const Turned robot : {walk, waddle}) {
      Comparison late(robot, Matrix3d::Identity(), late_s);
      late.drive(120.0);
      EXPECT_FALSE(late.check.is_wrong()) << late_s;
      EXPECT_FALSE(late.check.is_in_degrees()) << late_s;
    }
  }
  Comparison exchanged(waddle, turned_by({0, 0, 90}));
  exchanged.drive(15.0);
  EXPECT_FALSE(exchanged.check.is_wrong()) << "a delay may be the cause";
}

TEST(AxesCheck, SlowTurnsAreSummed) {
  Comparison turned(roll_over_slopes, turned_by({0, 0, 180}), 0.0, 0.05);
  turned.drive(60.0);
  EXPECT_TRUE(turned.check.is_wrong());
  Comparison sound(roll_over_slopes, Matrix3d::Identity(), 0.0, 0.05);
  sound.drive(600.0);
  EXPECT_FALSE(sound.check.is_wrong());
}

/// However large its turn, and however long the time since the last.
TEST(AxesCheck, OneSweepDoesNotDecide) {
  AxesCheck check;
  AxesCheck::GyroTurns gyro_rad;
  gyro_rad.fill({-1.0, -1.0, 1.0});
  check.add({1.0, 1.0, 1.0}, gyro_rad, 60.0);
  EXPECT_FALSE(check.is_wrong());
}

TEST(AxesCheck, DecisionIsFinal) {
  Comparison sound(walk, Matrix3d::Identity()), turned(walk, turned_by({0, 0, 180}));
  sound.drive(60.0);
  turned.drive(60.0);
  ASSERT_TRUE(turned.check.is_wrong());
  std::swap(sound.check, turned.check);
  sound.drive(600.0);
  turned.drive(600.0);
  EXPECT_TRUE(sound.check.is_wrong()) << "a gyro that was wrong measures soundly";
  EXPECT_FALSE(turned.check.is_wrong()) << "a gyro that was confirmed is turned";
}

/// Wrong for certain before it is known how.
TEST(AxesCheck, WrongRemainsWrongWithoutAxes) {
  Comparison upside_down(turn_on_level_ground, turned_by({180, 0, 0})), sound(walk, Matrix3d::Identity());
  upside_down.drive(60.0);
  ASSERT_TRUE(upside_down.check.is_wrong());
  std::swap(upside_down.check, sound.check);
  sound.drive(600.0);
  EXPECT_TRUE(sound.check.is_wrong());
}

Matrix3d scaled_by(double scale) { return scale * Matrix3d::Identity(); }

TEST(AxesCheck, GyroInDegreesIsFoundInTurns) {
  for (const Turned robot : {walk, turn_on_level_ground}) {
    Comparison in_degrees(robot, scaled_by(1.0 / kRadPerDeg));
    in_degrees.drive(20.0);
    EXPECT_TRUE(in_degrees.check.is_in_degrees());
    EXPECT_FALSE(in_degrees.check.is_wrong());
  }
}

/// The gyro may just as well be noisy.
TEST(AxesCheck, GyroInDegreesIsNotFoundInVibrations) {
  Comparison at_rest(vibrate, scaled_by(1.0 / kRadPerDeg));
  at_rest.drive(600.0);
  EXPECT_FALSE(at_rest.check.is_in_degrees());
}

TEST(AxesCheck, GyroOfAnotherScaleIsNotInDegrees) {
  for (const double scale : {0.0, 0.5, 2.0, 9.55, 20.0, 150.0, 1000.0, -1.0 / kRadPerDeg}) {
    Comparison scaled(walk, scaled_by(scale));
    scaled.drive(600.0);
    EXPECT_FALSE(scaled.check.is_in_degrees()) << scale;
  }
}

/// A lidar that has lost its way reports turns that have nothing to do with the gyro's.
TEST(AxesCheck, UnrelatedTurnsAreNoEvidence) {
  std::mt19937 random(11);
  std::normal_distribution<double> turn_rad(0.0, 0.03);
  const auto any_turn = [&] { return Vector3d{turn_rad(random), turn_rad(random), turn_rad(random)}; };
  for (int drive = 0; drive < 50; ++drive) {
    AxesCheck check;
    for (int sweep = 0; sweep < 3000; ++sweep) {
      AxesCheck::GyroTurns gyro_rad;
      gyro_rad.fill(any_turn());
      check.add(any_turn(), gyro_rad, kSweep_s);
    }
    ASSERT_FALSE(check.is_wrong()) << drive;
    ASSERT_FALSE(check.is_in_degrees()) << drive;
  }
}

} // namespace
} // namespace locus
