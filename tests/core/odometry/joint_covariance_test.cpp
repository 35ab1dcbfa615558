// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/joint_covariance.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <random>

namespace locus {
namespace {

constexpr int kStateCount = JointCovariance::kCommonStates + 5; ///< five states of sources
constexpr Block<3> kSome{4};
constexpr int kOfSource = kStateCount - 2; ///< a state of a source

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

/// A covariance in which all states are correlated.
JointCovariance correlated() {
  const Eigen::MatrixXd root = random_matrix(kStateCount, kStateCount, 1);
  JointCovariance P;
  P.resize(kStateCount);
  P.reset(0, root * root.transpose());
  return P;
}

double largest_difference(const JointCovariance& P, const Eigen::MatrixXd& expected) {
  return (P.matrix() - expected).cwiseAbs().maxCoeff();
}

TEST(JointCovariance, ResetStatesAreIndependentOfTheOthers) {
  JointCovariance P = correlated();
  Eigen::MatrixXd expected = P.matrix();
  P.reset(kSome.begin, Eigen::Matrix3d{Eigen::Vector3d(1, 2, 3).asDiagonal()});
  expected.middleRows<3>(kSome.begin).setZero();
  expected.middleCols<3>(kSome.begin).setZero();
  expected.block<3, 3>(kSome.begin, kSome.begin) = Eigen::Vector3d(1, 2, 3).asDiagonal();
  EXPECT_EQ(largest_difference(P, expected), 0.0);
}

TEST(JointCovariance, PropagatesLikeTheWholeJacobian) {
  JointCovariance P = correlated();
  const JointCovariance::Common F = random_matrix(JointCovariance::kCommonStates, JointCovariance::kCommonStates, 2);
  Eigen::MatrixXd whole = Eigen::MatrixXd::Identity(kStateCount, kStateCount);
  whole.topLeftCorner<JointCovariance::kCommonStates, JointCovariance::kCommonStates>() = F;
  const Eigen::MatrixXd expected = whole * P.matrix() * whole.transpose();
  P.propagate(F);
  EXPECT_LT(largest_difference(P, expected), 1e-12 * expected.norm());
}

TEST(JointCovariance, CouplesLikeTheWholeJacobian) {
  JointCovariance P = correlated();
  const Eigen::Vector3d factors{0.5, -2.0, 3.0};
  Eigen::MatrixXd whole = Eigen::MatrixXd::Identity(kStateCount, kStateCount);
  whole.block<3, 1>(kSome.begin, kOfSource) = factors;
  const Eigen::MatrixXd expected = whole * P.matrix() * whole.transpose();
  P.couple(kSome, factors, kOfSource);
  EXPECT_LT(largest_difference(P, expected), 1e-12 * expected.norm());
}

TEST(JointCovariance, RevertingStateEndsAtItsStationaryVariance) {
  JointCovariance P = correlated();
  P.revert(kOfSource, 0.5, 0.04);
  for (int i = 0; i < 100; ++i)
    P.revert(kOfSource, 0.5, 0.04);
  EXPECT_NEAR(P.variance(kOfSource), 0.04, 1e-12);
  EXPECT_LT(P.matrix().row(kOfSource).head(kOfSource).cwiseAbs().maxCoeff(), 1e-12) << "and forgets the others";
}

TEST(JointCovariance, StationaryVarianceIsRetained) {
  JointCovariance P;
  P.resize(kStateCount);
  P.add_variance(kOfSource, 0.04);
  P.revert(kOfSource, 0.9, 0.04);
  EXPECT_NEAR(P.variance(kOfSource), 0.04, 1e-15);
}

/// The information form of a measurement with the row h and variance v: P^-1 + h h' / v.
TEST(JointCovariance, ConditionIsTheKalmanUpdate) {
  JointCovariance P = correlated();
  const JointCovariance::State h = random_matrix(kStateCount, 1, 3);
  constexpr double kVariance = 0.3;
  const Eigen::MatrixXd expected = (Eigen::MatrixXd{P.matrix()}.inverse() + h * h.transpose() / kVariance).inverse();
  const JointCovariance::State Ph = P.matrix() * h;
  P.condition(Ph, JointCovariance::State::Zero(kStateCount), h.dot(Ph) + kVariance);
  EXPECT_LT(largest_difference(P, expected), 1e-6 * expected.norm());
}

TEST(JointCovariance, ConsideredStatesStayAsUncertainAsTheyWere) {
  JointCovariance P = correlated();
  const Eigen::MatrixXd before = P.matrix();
  const JointCovariance::State h = random_matrix(kStateCount, 1, 3), Ph = P.matrix() * h;
  JointCovariance::State considered = JointCovariance::State::Zero(kStateCount);
  part(considered, kSome) = part(Ph, kSome);
  P.condition(Ph, considered, h.dot(Ph) + 0.3);
  EXPECT_LT((P.block(kSome, kSome) - before.block<3, 3>(kSome.begin, kSome.begin)).norm(), 1e-9 * before.norm());
  EXPECT_LT(P.variance(kOfSource), before(kOfSource, kOfSource)) << "an estimated state";
  EXPECT_GT((P.matrix().row(kOfSource) - before.row(kOfSource)).segment<3>(kSome.begin).norm(), 1e-3)
      << "correlations with it are updated";
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P.matrix()).eigenvalues()[0], -1e-9);
}

TEST(JointCovariance, RaisesOnlyWhatIsBelow) {
  JointCovariance P;
  P.resize(kStateCount);
  P.add_variance(kSome, {1.0, 2.0, 3.0});
  P.raise(kSome, {2.0, 2.0, 2.0});
  EXPECT_EQ(Eigen::Vector3d{P.variances(kSome)}, Eigen::Vector3d(2.0, 2.0, 3.0));
  P.add_covariance(kSome, Eigen::Matrix3d::Ones());
  EXPECT_EQ(P.matrix()(kSome.begin, kSome.begin + 1), 1.0);
  EXPECT_EQ(P.variance(kSome.begin), 3.0);
}

} // namespace
} // namespace locus
