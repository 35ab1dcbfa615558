// SPDX-License-Identifier: Apache-2.0
#include "accuracy/consistency.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <vector>

namespace locus {
namespace {

using std::chrono::seconds;

/// A drive at 1 m/s along x, with an error and a stated covariance.
struct Drive {
  std::vector<StampedPose> truth, estimates;
  std::vector<Matrix6> covariances;

  [[nodiscard]] std::optional<Consistency> judged() const { return consistency(estimates, covariances, truth); }
};

template <class ErrorAt> Drive drive(int poses, double variance_per_metre, ErrorAt&& error_at) {
  Drive result;
  for (int i = 0; i < poses; ++i) {
    const Pose T_truth{Eigen::Quaterniond::Identity(), {1.0 * i, 0, 0}};
    const Stamp stamp = stamp_from_ns(1'000'000'000'000) + i * seconds{1};
    result.truth.push_back({stamp, T_truth});
    result.estimates.push_back({stamp, error_at(i) * T_truth});
    result.covariances.push_back(Matrix6::Identity() * (i * variance_per_metre));
    result.covariances.back().diagonal().tail<3>() /= 1e4; // so that yaw errors do not matter 10 m ahead
  }
  return result;
}

Pose shifted(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0, 0}}; }

TEST(Consistency, ErrorOfOneSigmaOnOneAxisIsOne) {
  // Errors over 10 m are 0.1 m, and the sum of both variances is 0.01 m^2.
  Drive twenty = drive(21, 0.0, [](int i) { return shifted(i < 10 ? 0.0 : 0.1); });
  for (Matrix6& covariance : twenty.covariances)
    covariance.diagonal().setConstant(0.005);
  for (Matrix6& covariance : twenty.covariances)
    covariance.diagonal().tail<3>() /= 1e4;
  const auto judged = twenty.judged();
  ASSERT_TRUE(judged && judged->nees_10m);
  EXPECT_NEAR(*judged->nees_10m, 10.0 / 11.0, 0.01) << "of eleven stretches one lies beyond the step";
}

TEST(Consistency, NeesOfIndependentPosesIsSix) {
  constexpr double kSigma_m = 0.01, kSigma_rad = 0.001;
  std::mt19937 random{1};
  std::normal_distribution<double> error_m(0.0, kSigma_m), error_rad(0.0, kSigma_rad);
  Drive walk = drive(20'000, 0.0, [](int) { return Pose{}; });
  for (std::size_t i = 0; i < walk.estimates.size(); ++i) {
    Pose& T_odom_base = walk.estimates[i].T_source_base;
    T_odom_base.translation += Eigen::Vector3d{error_m(random), error_m(random), error_m(random)};
    T_odom_base.rotation = so3_exp({error_rad(random), error_rad(random), error_rad(random)});
    walk.covariances[i].diagonal() << Eigen::Vector3d::Constant(kSigma_m * kSigma_m),
        Eigen::Vector3d::Constant(kSigma_rad * kSigma_rad);
  }
  const auto judged = walk.judged();
  ASSERT_TRUE(judged && judged->nees_10m);
  EXPECT_NEAR(*judged->nees_10m, 6.0, 0.3);
}

TEST(Consistency, IsAbsentWithoutTenMetres) {
  const auto judged = drive(5, 0.001, [](int) { return Pose{}; }).judged();
  ASSERT_TRUE(judged);
  EXPECT_FALSE(judged->nees_10m);
  EXPECT_EQ(judged->worst_sigma, 0.0);
}

TEST(Consistency, WorstPositionIsFoundAnywhere) {
  // After 50 m the stated standard deviation is 0.1 m.
  const auto judged = drive(100, 0.0002, [](int i) { return shifted(i == 50 ? 0.4 : 0.0); }).judged();
  ASSERT_TRUE(judged);
  EXPECT_NEAR(judged->worst_sigma, 4.0, 1e-6);
}

TEST(Consistency, ErrorBelowACentimetreIsIgnored) {
  EXPECT_EQ(drive(20, 1e-12, [](int) { return Pose{}; }).judged()->worst_sigma, 0.0);
  EXPECT_EQ(drive(20, 1e-12, [](int i) { return shifted(i == 3 ? 0.009 : 0.0); }).judged()->worst_sigma, 0.0);
}

TEST(Consistency, IsAbsentWithTruthOfAnotherTime) {
  Drive other = drive(20, 0.001, [](int) { return Pose{}; });
  for (StampedPose& pose : other.truth)
    pose.stamp += std::chrono::hours{1};
  EXPECT_FALSE(other.judged());
}

} // namespace
} // namespace locus
