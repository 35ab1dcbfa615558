// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/prior_statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace locus {
namespace {

const Vector6 kInitial = Vector6::Constant(0.1);
const PriorExpectation kExpectation{.sigma = kInitial, .bias = 0.5 * kInitial, .least_sigma = Vector6::Constant(0.002)};
const Matrix6 kSeesAll = 1e6 * Matrix6::Identity();

TEST(PriorStatistics, BeginsWithWhatItWasTold) {
  const PriorStatistics statistics(kExpectation);
  EXPECT_TRUE(statistics.variance(1.0).isApprox(kInitial.cwiseAbs2()));
}

TEST(PriorStatistics, LearnsTheSpreadOfEachAxis) {
  PriorStatistics statistics(kExpectation);
  std::mt19937 random{1};
  std::normal_distribution<double> normal;
  Vector6 sigma;
  sigma << 0.01, 0.02, 0.03, 0.04, 0.05, 0.06;
  Vector6 mean_variance = Vector6::Zero();
  constexpr int kSweeps = 3000;
  for (int i = 0; i < kSweeps; ++i) {
    Vector6 difference;
    for (int axis = 0; axis < 6; ++axis)
      difference[axis] = sigma[axis] * normal(random);
    statistics.learn(difference, kSeesAll);
    mean_variance += statistics.variance(1.0) / kSweeps;
  }
  for (int axis = 0; axis < 6; ++axis)
    EXPECT_NEAR(std::sqrt(mean_variance[axis]), sigma[axis], 0.1 * sigma[axis]);
}

TEST(PriorStatistics, NeverBelievesMoreThanTheLeast) {
  PriorStatistics statistics(kExpectation);
  for (int i = 0; i < 1000; ++i)
    statistics.learn(Vector6::Zero(), kSeesAll);
  EXPECT_TRUE(statistics.variance(1.0).isApprox(kExpectation.least_sigma.cwiseAbs2()));
}

TEST(PriorStatistics, ForgetsWhatALongTimeAgoWasSo) {
  PriorStatistics statistics(kExpectation);
  for (int i = 0; i < 1000; ++i)
    statistics.learn(Vector6::Zero(), kSeesAll);
  for (int i = 0; i < 100; ++i)
    statistics.learn(Vector6::Constant(0.05), kSeesAll);
  EXPECT_GT(statistics.variance(1.0).minCoeff(), 0.9 * 0.05 * 0.05);
}

TEST(PriorStatistics, AnAxisThatThePointsDoNotSeeTeachesNothing) {
  PriorStatistics statistics(kExpectation);
  Matrix6 blind_along_x = kSeesAll;
  blind_along_x(0, 0) = 1.0; // a standard deviation of a metre
  for (int i = 0; i < 1000; ++i)
    statistics.learn(Vector6::Zero(), blind_along_x);
  EXPECT_DOUBLE_EQ(statistics.variance(1.0)[0], 0.01);
  EXPECT_DOUBLE_EQ(statistics.variance(1.0)[1], 0.002 * 0.002);
}

TEST(PriorStatistics, TheBiasIsWhatIsLeftOfErrorsWhenTheirNoiseHasGoneOut) {
  PriorStatistics statistics(kExpectation);
  EXPECT_TRUE(statistics.bias(1.0).isApprox(0.5 * kInitial))
      << "who is not known yet may err the same way all the time";
  std::mt19937 random{1};
  std::normal_distribution<double> normal;
  for (int i = 0; i < 3000; ++i) {
    Vector6 difference = Vector6::Constant(-0.01);
    for (int axis = 0; axis < 6; ++axis)
      difference[axis] += 0.005 * normal(random);
    statistics.learn(difference, kSeesAll);
  }
  EXPECT_NEAR(statistics.bias(1.0).mean(), 0.01, 0.001);
  EXPECT_NEAR(statistics.bias(100.0).mean(), 1.0, 0.1);
}

TEST(PriorStatistics, TheDeviationGrowsWithTheTimeBetween) {
  const PriorStatistics statistics(kExpectation);
  EXPECT_TRUE(statistics.variance(10.0).isApprox(100.0 * kInitial.cwiseAbs2()));
}

} // namespace
} // namespace locus
