// SPDX-License-Identifier: Apache-2.0
#include "core/map/gicp_kernel.hpp"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace locus {
namespace {

const SurfaceMap kNoMap(1'000'000);
constexpr double kWidth2 = 12.25;

/// A block of points and their correspondences, in the frame of the pass.
struct MatchedPoints {
  std::vector<SurfacePoint> points;
  MatchBlock matches{};
  Pose T_target_source;

  [[nodiscard]] SourceBlock source() const { return SourceBlock(points); }

  /// Adds a point that lies at `off_m` from its correspondence: a plane, or, without a normal, a ball.
  void add(const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal, const Eigen::Vector3d& off_m,
           double variance_m2, const Eigen::Vector3f& own_normal = Eigen::Vector3f::Zero()) {
    const std::size_t i = points.size();
    points.push_back({point_m.cast<float>(), own_normal});
    const Eigen::Vector3d mean_m = T_target_source * point_m - off_m;
    matches.x_m[i] = static_cast<float>(mean_m.x());
    matches.y_m[i] = static_cast<float>(mean_m.y());
    matches.z_m[i] = static_cast<float>(mean_m.z());
    matches.normal_x[i] = static_cast<float>(normal.x());
    matches.normal_y[i] = static_cast<float>(normal.y());
    matches.normal_z[i] = static_cast<float>(normal.z());
    matches.across_m2[i] = static_cast<float>(variance_m2);
    matches.found[i] = 1.0F;
  }
};

GicpPass pass_at(const Pose& T_target_source) {
  return {.target = kNoMap,
          .T_target_source = T_target_source,
          .origin_m = Eigen::Vector3d::Zero(),
          .look_up = LookUp::reuse,
          .accepts_shapeless = false,
          .max_correspondence_m = 1.0,
          .width2 = kWidth2,
          .axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
}

NormalEquations equations_of(const MatchedPoints& scene, Isa isa = Isa::baseline) {
  FitBlock fit;
  return linearise(pass_at(scene.T_target_source), scene.source(), scene.matches, isa, fit);
}

/// Half the Geman-McClure cost of all points at a pose, in double precision and without any derivative.
double cost_at(const MatchedPoints& scene, const Pose& T_target_source) {
  double cost = 0.0;
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    const MatchBlock& m = scene.matches;
    const Eigen::Vector3d mean_m = Eigen::Vector3f(m.x_m[i], m.y_m[i], m.z_m[i]).cast<double>();
    const Eigen::Vector3d normal = Eigen::Vector3f(m.normal_x[i], m.normal_y[i], m.normal_z[i]).cast<double>();
    const Eigen::Vector3d off_m = T_target_source * scene.points[i].position_m.cast<double>().eval() - mean_m;
    const double squared_m2 = normal.isZero() ? off_m.squaredNorm() : std::pow(normal.dot(off_m), 2);
    const double r2 = squared_m2 / static_cast<double>(m.across_m2[i] + kPointVariance_m2);
    cost += 0.5 * kWidth2 * r2 / (kWidth2 + r2);
  }
  return cost;
}

Pose displaced(const Pose& T, const Vector6& step) {
  return {so3_exp(step.tail<3>()) * T.rotation, T.translation + step.head<3>()};
}

/// Planes of any orientation, every fifth a ball, each `off_m` from its point (one standard deviation).
MatchedPoints surroundings(double off_m) {
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  const auto any = [&] { return Eigen::Vector3d{normal(random), normal(random), normal(random)}; };
  MatchedPoints scene;
  scene.T_target_source = {so3_exp({0.1, -0.2, 0.7}), {1.0, 2.0, -0.5}};
  for (int i = 0; i < 200; ++i)
    scene.add(5.0 * any(), i % 5 == 0 ? Eigen::Vector3d::Zero().eval() : any().normalized(), off_m * any(), 4e-4);
  return scene;
}

TEST(GicpKernel, GradientIsThatOfTheRobustCost) {
  const MatchedPoints scene = surroundings(0.05);
  constexpr double kStep = 1e-6;
  Vector6 expected;
  for (int axis = 0; axis < 6; ++axis) {
    const Vector6 step = kStep * Vector6::Unit(axis);
    expected[axis] = (cost_at(scene, displaced(scene.T_target_source, step)) -
                      cost_at(scene, displaced(scene.T_target_source, -step))) /
                     (2.0 * kStep);
  }
  EXPECT_LT((equations_of(scene).b - expected).norm(), 1e-3 * expected.norm());
}

TEST(GicpKernel, HessianPredictsTheCostOfASmallMotion) {
  const MatchedPoints scene = surroundings(0.0);
  const Matrix6 H = equations_of(scene).H;
  std::mt19937 random{6};
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20; ++i) {
    Vector6 step;
    for (int axis = 0; axis < 6; ++axis)
      step[axis] = (axis < 3 ? 1e-4 : 2e-5) * normal(random);
    EXPECT_NEAR(cost_at(scene, displaced(scene.T_target_source, step)) / (0.5 * step.dot(H * step)), 1.0, 0.01);
  }
}

TEST(GicpKernel, HessianIsSymmetricAndPositive) {
  const Matrix6 H = equations_of(surroundings(0.05)).H;
  EXPECT_EQ(H, Matrix6{H.transpose()});
  EXPECT_GT(H.ldlt().vectorD().minCoeff(), 0.0);
}

/// A wall across y whose normals, and those of the points on it, are off by 0.1 rad towards x, each by an error of its
/// own or both by the same.
MatchedPoints rough_wall(bool same_error) {
  std::mt19937 random{7};
  std::normal_distribution<double> error{0.0, 0.1};
  MatchedPoints scene;
  for (std::size_t i = 0; i < kGicpBlock; ++i) {
    const Eigen::Vector3d normal = Eigen::Vector3d{error(random), 1.0, 0.0}.normalized();
    const Eigen::Vector3d own = Eigen::Vector3d{error(random), 1.0, 0.0}.normalized();
    scene.add({0.01 * static_cast<double>(i), 2.0, 0.0}, normal, Eigen::Vector3d::Zero(), 1e-4,
              (same_error ? normal : own).cast<float>());
  }
  return scene;
}

TEST(GicpKernel, NoiseOfNormalsIsNotObserved) {
  const NormalEquations noisy = equations_of(rough_wall(false));
  EXPECT_LT(std::abs(noisy.observed[0]), 0.3 * noisy.H(0, 0));
  EXPECT_NEAR(noisy.observed[1] / noisy.H(1, 1), 1.0, 0.1);
  const NormalEquations real = equations_of(rough_wall(true));
  EXPECT_NEAR(real.observed[0] / real.H(0, 0), 1.0, 1e-3) << "surfaces that face x";
}

TEST(GicpKernel, NoiseOfNormalsIsNotObservedWithoutASecondOne) {
  MatchedPoints scene = rough_wall(true);
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    scene.points[i].normal.setZero();
    scene.matches.tilt_rad2[i] = 0.1F * 0.1F;
  }
  const NormalEquations found = equations_of(scene);
  EXPECT_LT(std::abs(found.observed[0]), 0.3 * found.H(0, 0));
  EXPECT_NEAR(found.observed[1] / found.H(1, 1), 1.0, 0.1);
}

TEST(GicpKernel, PointWithoutANormalHasThatOfItsPlane) {
  MatchedPoints scene = surroundings(0.0);
  const NormalEquations found = equations_of(scene);
  for (int axis = 0; axis < 6; ++axis)
    EXPECT_NEAR(found.observed[axis] / found.H(axis, axis), 1.0, 1e-4) << axis;
}

TEST(GicpKernel, SideOfANormalDoesNotMatter) {
  MatchedPoints scene = rough_wall(false);
  const NormalEquations found = equations_of(scene);
  for (SurfacePoint& point : scene.points)
    point.normal *= -1.0F;
  const NormalEquations reversed = equations_of(scene);
  EXPECT_EQ(reversed.H, found.H);
  EXPECT_EQ(reversed.observed, found.observed);
  EXPECT_EQ(reversed.sides, found.sides);
}

/// An error of one metre common to all points adds to b what `sides` says, if each point has the worse sign.
TEST(GicpKernel, SidesAreTheWorstCommonError) {
  MatchedPoints scene;
  for (const double side : {-1.0, 1.0}) // two walls that face each other
    scene.add({side, 0, 0}, {-side, 0, 0}, Eigen::Vector3d::Zero(), 4e-4);
  const NormalEquations found = equations_of(scene);
  EXPECT_NEAR(found.sides[0], found.H(0, 0), 1e-3 * found.H(0, 0));
  EXPECT_EQ(found.sides[1], 0.0);
}

TEST(GicpKernel, PointBeyondTheWidthIsNoInlier) {
  const double sigma_m = std::sqrt(4e-4 + static_cast<double>(kPointVariance_m2));
  MatchedPoints scene;
  for (const double sigmas : {0.99, 1.01})
    scene.add({1, 2, 3}, Eigen::Vector3d::UnitX(), sigmas * std::sqrt(kWidth2) * sigma_m * Eigen::Vector3d::UnitX(),
              4e-4);
  FitBlock fit;
  const NormalEquations found =
      linearise(pass_at(scene.T_target_source), scene.source(), scene.matches, Isa::baseline, fit);
  EXPECT_EQ(found.inliers, 1U);
  EXPECT_EQ(found.planes, 2U);
  EXPECT_EQ(fit.mapped[0], 1.0F);
  EXPECT_EQ(fit.mapped[1], 0.0F);
}

TEST(GicpKernel, PointAtTheWidthHasAQuarterOfTheWeight) {
  const double sigma_m = std::sqrt(4e-4 + static_cast<double>(kPointVariance_m2));
  MatchedPoints scene;
  scene.add({1, 2, 3}, Eigen::Vector3d::UnitX(), std::sqrt(kWidth2) * sigma_m * Eigen::Vector3d::UnitX(), 4e-4);
  const NormalEquations found = equations_of(scene);
  EXPECT_NEAR(found.weight, 0.25, 1e-3);
  EXPECT_NEAR(found.error, 0.25 * kWidth2, 0.01);
}

TEST(GicpKernel, UnmatchedPointsAddNothing) {
  MatchedPoints scene = surroundings(0.05);
  scene.matches.found.fill(0.0F);
  const NormalEquations found = equations_of(scene);
  EXPECT_EQ(found.H, Matrix6::Zero());
  EXPECT_EQ(found.b, Vector6::Zero());
  EXPECT_EQ(found.weight, 0.0);
  EXPECT_EQ(found.inliers + found.planes, 0U);
}

TEST(GicpKernel, InstructionSetsDifferByRoundingOnly) {
  const MatchedPoints scene = surroundings(0.05);
  const NormalEquations expected = equations_of(scene);
  for (const Isa isa : {Isa::avx2, Isa::avx512}) {
    if (!is_supported(isa))
      continue;
    const NormalEquations found = equations_of(scene, isa);
    EXPECT_LT((found.H - expected.H).norm(), 1e-5 * expected.H.norm());
    EXPECT_LT((found.b - expected.b).norm(), 1e-3 * expected.b.norm());
    EXPECT_EQ(found.inliers, expected.inliers);
  }
}

TEST(GicpKernel, ShapelessMatchIsAThirdOfAPlaneAlongEachAxis) {
  MatchedPoints scene;
  for (int i = 0; i < 2; ++i)
    scene.add({1, 2, 3}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero(), 4e-4);
  scene.add({1, 2, 3}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 4e-4);
  const Normals normals = normals_of(scene.matches, Isa::baseline);
  EXPECT_EQ(normals.points, 3.0);
  const Eigen::Matrix3d expected = Eigen::Vector3d{2.0 + 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0}.asDiagonal();
  EXPECT_LT((normals.squares - expected).norm(), 1e-6);
}

/// A point on a plane has (n, R p x n) (n, R p x n)', whatever the variance of the plane.
TEST(GicpKernel, GradientsMeasureWhereSurfacesAre) {
  const Eigen::Vector3d point_m{1, 2, 3}, normal = Eigen::Vector3d{1, 1, 0}.normalized();
  const Pose T{so3_exp({0, 0, 0.5}), {7, 8, 9}};
  MatchedPoints scene;
  scene.T_target_source = T;
  for (const double variance_m2 : {1e-4, 1.0})
    scene.add(point_m, normal, Eigen::Vector3d::Zero(), variance_m2);
  Vector6 gradient;
  gradient << normal, (T.rotation * point_m).cross(normal);
  const Matrix6 found = gradients_of(T.R(), scene.source(), scene.matches, Isa::baseline);
  EXPECT_LT((found - 2.0 * gradient * gradient.transpose()).norm(), 1e-4);
}

} // namespace
} // namespace locus
