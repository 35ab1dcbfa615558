// SPDX-License-Identifier: Apache-2.0
#include "core/base/principal_axes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <cmath>
#include <random>

namespace locus {
namespace {

using Solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>;

/// Returns a covariance with these variances along randomly oriented axes.
Eigen::Matrix3d scatter(const Eigen::Vector3d& variance, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> any;
  const Eigen::Matrix3d R =
      Eigen::Quaterniond{any(random), any(random), any(random), any(random)}.normalized().toRotationMatrix();
  return R * variance.asDiagonal() * R.transpose();
}

template <class Real> PrincipalAxes<Real> axes_of(const Eigen::Matrix3d& m) {
  const auto of = [&](int row, int column) { return static_cast<Real>(m(row, column)); };
  return principal_axes<Real>({of(0, 0), of(0, 1), of(0, 2), of(1, 1), of(1, 2), of(2, 2)});
}

TEST(PrincipalAxes, OfAPlaneEqualThoseOfAGeneralSolver) {
  for (unsigned seed = 0; seed < 1000; ++seed) {
    const double middle = std::pow(10.0, -2.0 + 0.002 * seed), least = 1e-4 + 1e-4 * (seed % 100) * middle;
    const Eigen::Matrix3d m = scatter({least, middle, 1.5 * middle}, seed);
    const Solver truth(m);
    const PrincipalAxes<float> axes = axes_of<float>(m);
    ASSERT_NEAR(axes.least, truth.eigenvalues()[0], 1e-5 * middle + 1e-3 * least) << "seed " << seed;
    ASSERT_NEAR(axes.middle, truth.eigenvalues()[1], 2e-3 * middle);
    ASSERT_NEAR(axes.greatest, truth.eigenvalues()[2], 2e-3 * middle);
    const Eigen::Vector3d axis = Eigen::Vector3f(axes.x, axes.y, axes.z).cast<double>();
    ASSERT_NEAR(axis.norm(), 1.0, 1e-5);
    ASSERT_NEAR(std::abs(axis.dot(truth.eigenvectors().col(0))), 1.0, 1e-5);
  }
}

TEST(PrincipalAxes, OfABallOrALineAreNotPlanar) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    const PrincipalAxes<double> ball = axes_of<double>(scatter({1.0, 1.0, 1.0}, seed));
    EXPECT_GT(ball.least, 0.5 * ball.middle);
    EXPECT_NEAR(ball.greatest, 1.0, 0.3);
    const PrincipalAxes<double> line = axes_of<double>(scatter({1e-4, 1e-4, 1.0}, seed));
    EXPECT_LT(line.middle, 1e-3);
    EXPECT_NEAR(line.greatest, 1.0, 1e-3);
  }
}

/// All variances but the greatest are rounding errors, of either sign.
TEST(PrincipalAxes, OfTwoPointsAreFinite) {
  std::mt19937 random{1};
  std::uniform_real_distribution<float> within{-0.25F, 0.25F};
  const auto any = [&] { return Eigen::Vector3f{within(random), within(random), within(random)}; };
  for (int pair = 0; pair < 10000; ++pair) {
    const Eigen::Vector3f a = any(), b = any(), mean = 0.5F * (a + b);
    const Eigen::Matrix3f m = 0.5F * (a * a.transpose() + b * b.transpose()) - mean * mean.transpose();
    const PrincipalAxes<float> axes = axes_of<float>(m.cast<double>());
    for (const float figure : {axes.least, axes.middle, axes.greatest, axes.x, axes.y, axes.z})
      ASSERT_TRUE(std::isfinite(figure)) << pair;
    ASSERT_LT(axes.middle, 1e-3F * axes.greatest) << pair;
  }
}

TEST(PrincipalAxes, OfCoincidentPointsAreFinite) {
  const PrincipalAxes<float> axes = axes_of<float>(Eigen::Matrix3d::Zero());
  for (const float figure : {axes.least, axes.middle, axes.greatest, axes.x, axes.y, axes.z})
    EXPECT_EQ(figure, 0.0F);
}

} // namespace
} // namespace locus
