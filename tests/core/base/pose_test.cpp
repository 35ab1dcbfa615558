// SPDX-License-Identifier: Apache-2.0
#include "core/base/pose.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <random>

namespace locus {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d{normal(random), normal(random), normal(random)}.normalized();
}

double largest_difference(const Pose& a, const Pose& b) {
  return std::max((a.R() - b.R()).cwiseAbs().maxCoeff(), (a.translation - b.translation).cwiseAbs().maxCoeff());
}

class PoseAtAngle : public testing::TestWithParam<double> {};

TEST_P(PoseAtAngle, ExponentialAndLogarithmUndoEachOther) {
  std::mt19937_64 random{1};
  for (int i = 0; i < 100; ++i) {
    Vector6 tangent;
    tangent << 10 * random_direction(random), GetParam() * random_direction(random);
    EXPECT_LT((so3_log(so3_exp(tangent.tail<3>())) - tangent.tail<3>()).norm(), 1e-9);
    EXPECT_LT((se3_log(se3_exp(tangent)) - tangent).norm(), 1e-7);
    EXPECT_NEAR(angle_rad(so3_exp(tangent.tail<3>())), GetParam(), 1e-9);
  }
}

TEST_P(PoseAtAngle, ExponentialIsTheLimitOfManySmallSteps) {
  std::mt19937_64 random{2};
  Vector6 tangent;
  tangent << random_direction(random), GetParam() * random_direction(random);
  constexpr int kSteps = 4096;
  Pose T;
  for (int i = 0; i < kSteps; ++i)
    T = T * Pose{so3_exp(tangent.tail<3>() / kSteps), tangent.head<3>() / kSteps};
  EXPECT_LT(largest_difference(T, se3_exp(tangent)), 2e-3);
}

TEST_P(PoseAtAngle, AdjointTransformsATwistToTheOtherFrame) {
  std::mt19937_64 random{3};
  const Pose T{so3_exp(GetParam() * random_direction(random)), 3 * random_direction(random)};
  Vector6 twist;
  twist << random_direction(random), random_direction(random);
  const Vector6 seen_from_a = adjoint(T) * twist;
  EXPECT_LT(largest_difference(T * se3_exp(twist) * T.inverse(), se3_exp(seen_from_a)), 1e-12);
}

// The closed forms are replaced by their series below 1e-4.
INSTANTIATE_TEST_SUITE_P(Angles, PoseAtAngle,
                         testing::Values(0.0, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1e-3, 0.5, 2.0, kPi - 1e-3, kPi - 1e-6));

TEST(Pose, LogarithmIsOfTheShorterRotation) {
  EXPECT_NEAR(so3_log(so3_exp({0, 0, kPi + 0.1})).z(), -kPi + 0.1, 1e-12);
  const Eigen::Quaterniond q = so3_exp({0.3, -0.2, 0.1});
  EXPECT_LT((so3_log(Eigen::Quaterniond{-q.coeffs()}) - so3_log(q)).norm(), 1e-15);
}

TEST(Pose, InverseUndoesIt) {
  const Pose T{so3_exp({0.3, -1.2, 2.1}), {3, -2, 7}};
  EXPECT_LT(largest_difference(T * T.inverse(), Pose{}), 1e-12);
  EXPECT_LT((T.inverse() * (T * Eigen::Vector3d{1, 2, 3}) - Eigen::Vector3d{1, 2, 3}).norm(), 1e-12);
}

TEST(Pose, AMillionProductsStayARotation) {
  const Pose step{so3_exp({1e-3, 2e-3, -3e-3}), {0.001, 0, 0}};
  Pose T;
  for (int i = 0; i < 1'000'000; ++i)
    T = T * step;
  EXPECT_NEAR(T.rotation.norm(), 1.0, 1e-12);
}

TEST(Pose, InterpolationMeetsItsEndsAndExtrapolates) {
  const Pose from{so3_exp({0, 0, 0.5}), {1, 2, 3}};
  const Pose to{so3_exp({0, 0, 1.5}), {2, 4, 3}};
  EXPECT_LT(largest_difference(interpolate(from, to, 0.0), from), 1e-12);
  EXPECT_LT(largest_difference(interpolate(from, to, 1.0), to), 1e-12);
  EXPECT_LT(largest_difference(interpolate(from, to, 0.5), {so3_exp({0, 0, 1.0}), {1.5, 3, 3}}), 1e-12);
  EXPECT_LT(largest_difference(interpolate(from, to, 1.5), {so3_exp({0, 0, 2.0}), {2.5, 5, 3}}), 1e-12);
}

TEST(Pose, InterpolationIgnoresTheSignOfTheQuaternion) {
  const Pose from{so3_exp({0, 0, 0.1}), Eigen::Vector3d::Zero()};
  Pose to{so3_exp({0, 0, 0.3}), Eigen::Vector3d::Zero()};
  to.rotation.coeffs() *= -1.0;
  EXPECT_LT(largest_difference(interpolate(from, to, 0.5), {so3_exp({0, 0, 0.2}), Eigen::Vector3d::Zero()}), 1e-12);
}

TEST(Pose, DifferenceIsAlongTheAxesOfTheCommonFrame) {
  const Pose reference{so3_exp({0.1, 2.0, -0.3}), {1.0, 2.0, 3.0}};
  Vector6 off;
  off << 0.4, -0.5, 0.6, -0.1, 0.2, 0.3;
  const Pose T{so3_exp(off.tail<3>()) * reference.rotation, reference.translation + off.head<3>()};
  EXPECT_LT((difference(T, reference) - off).norm(), 1e-12);

  const Pose T_b_a{so3_exp({0.7, -0.2, 1.1}), Eigen::Vector3d::Zero()};
  EXPECT_LT((difference(T_b_a * T, T_b_a * reference) - turn_both(T_b_a.rotation) * off).norm(), 1e-12);
}

TEST(Pose, RollPitchYawRoundTrip) {
  for (const double yaw : {-3.0, 0.0, 1.0})
    for (const double pitch : {-1.5, 0.0, 0.7})
      for (const double roll : {-2.0, 0.0, 3.0})
        EXPECT_LT((to_rpy_rad(from_rpy_rad({roll, pitch, yaw})) - Eigen::Vector3d{roll, pitch, yaw}).norm(), 1e-9);
}

TEST(Pose, LookingStraightUpHasNoYaw) {
  const Eigen::Quaterniond up = from_rpy_rad({0.4, -kPi / 2, 0.3});
  EXPECT_EQ(to_rpy_rad(up).z(), 0.0);
  EXPECT_LT(angle_rad(from_rpy_rad(to_rpy_rad(up)).conjugate() * up), 1e-7);
}

TEST(Pose, NotANumberIsNotFinite) {
  Pose T;
  EXPECT_TRUE(T.finite());
  T.translation.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(T.finite());
}

} // namespace
} // namespace locus
