// SPDX-License-Identifier: Apache-2.0
#include "core/map/registration.hpp"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <random>

#include "core/surfaces.hpp"

namespace locus {
namespace {

constexpr std::size_t kBytes = 20'000'000;
constexpr RegistrationOptions kOptions{20, 1.0};
const MotionBelief kNoPrior;

bool never() { return false; }

SurfaceMap map_of(const std::vector<SurfacePoint>& points) {
  SurfaceMap map(kBytes);
  map.insert(points, Pose{});
  return map;
}

double off_m(const Pose& found, const Pose& truth) { return (found.translation - truth.translation).norm(); }
double off_deg(const Pose& found, const Pose& truth) {
  return angle_rad(truth.rotation.conjugate() * found.rotation) / kRadPerDeg;
}

bool same_bits(const Registration& a, const Registration& b) {
  return a.T_target_source == b.T_target_source && a.iterations == b.iterations && a.inliers == b.inliers &&
         a.mean_error == b.mean_error && a.information == b.information && a.object_costs == b.object_costs;
}

TEST(Gicp, FindsAKnownMotion) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01));
  Gicp gicp(1);
  std::mt19937 random{3};
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  const auto any = [&] { return Eigen::Vector3d{unit(random), unit(random), unit(random)}; };
  for (int i = 0; i < 20; ++i) {
    const Pose truth{so3_exp(5 * kRadPerDeg * any()), 0.2 * any()};
    const auto source = test::seen_from(truth, test::points_on(test::furnished_room(), 400, 2, 0.01));
    const Registration found = gicp.align({source}, map, Pose{}, kNoPrior, kOptions, false, never);
    EXPECT_TRUE(found.converged);
    EXPECT_LT(off_m(found.T_target_source, truth), 0.005);
    EXPECT_LT(off_deg(found.T_target_source, truth), 0.1);
    EXPECT_GT(found.inliers, source.size() / 2);
  }
}

TEST(Gicp, PointsNeedNoNormals) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01));
  const Pose truth{so3_exp({0.02, -0.01, 0.05}), {0.1, -0.15, 0.05}};
  const auto source = test::seen_from(truth, test::points_on(test::furnished_room(), 400, 2, 0.01));
  const Registration found =
      Gicp(1).align({test::without_normals(source)}, map, Pose{}, kNoPrior, kOptions, false, never);
  EXPECT_LT(off_m(found.T_target_source, truth), 0.01);
  EXPECT_LT(off_deg(found.T_target_source, truth), 0.1);
}

/// Points of a thicket without any surface, in clusters that move with the lidar as the pattern of its scan lines does.
/// Each has a voxel of its own, also in the coarse grid, and too many points to lie in a plane by chance.
std::vector<SurfacePoint> scan_lines_in_a_thicket() {
  std::mt19937 random{7};
  std::uniform_real_distribution<float> unit{-1.0F, 1.0F};
  const auto any = [&] { return Eigen::Vector3f{unit(random), unit(random), unit(random)}; };
  std::vector<SurfacePoint> points;
  for (int cluster = 0; cluster < 196; ++cluster) {
    const Eigen::Vector3f voxel_m =
        1.5F * Eigen::Vector3f{static_cast<float>(cluster % 14) - 7.0F, static_cast<float>(cluster / 14) - 7.0F, 0.0F};
    const Eigen::Vector3f centre_m = voxel_m + 0.05F * any();
    for (int i = 0; i < 12; ++i)
      points.push_back({centre_m + 0.1F * any(), Eigen::Vector3f::Zero()});
  }
  return points;
}

/// Registers the scan of a thicket with a map of it, from a start that the prior holds to `sigma_m`, 11 cm off the map.
Registration registered_off_a_thicket(int sweeps, double sigma_m) {
  const std::vector<SurfacePoint> scan = scan_lines_in_a_thicket();
  SurfaceMap map(kBytes);
  for (int i = 0; i < sweeps; ++i)
    map.insert(scan, Pose{});
  MotionBelief moved;
  moved.T_target_source.translation = {0.1, 0.05, 0.0};
  moved.information.diagonal().setConstant(1.0 / (sigma_m * sigma_m));
  return Gicp(1).align({scan}, map, moved.T_target_source, moved, kOptions, false, never);
}

TEST(Gicp, PatternOfOneSweepDoesNotHoldTheRobot) {
  const Registration found = registered_off_a_thicket(1, 0.03);
  EXPECT_EQ(found.T_target_source.translation, Eigen::Vector3d(0.1, 0.05, 0.0));
  EXPECT_EQ(found.information, Matrix12::Zero());
  EXPECT_GT(found.overlap(), 0.5);
}

TEST(Gicp, PointsOfSeveralSweepsAreAMeasurementWherePlanesAreFew) {
  EXPECT_LT(registered_off_a_thicket(2, 1.0).T_target_source.translation.norm(), 0.03);
}

TEST(Gicp, PointsOfOneSweepAreAMeasurementOfScanToScan) {
  const std::vector<SurfacePoint> scan = scan_lines_in_a_thicket();
  SurfaceMap last_scan(kBytes, best_isa(), true);
  last_scan.insert(scan, Pose{});
  const Pose start{Eigen::Quaterniond::Identity(), {0.1, 0.05, 0.0}};
  const Registration found = Gicp(1).align({scan}, last_scan, start, kNoPrior, kOptions, false, never);
  EXPECT_LT(found.T_target_source.translation.norm(), 0.03);
}

/// Registers a scan of a thicket, or of a room, both with a map of several sweeps.
Registration registered(const std::vector<SurfacePoint>& scan, std::optional<bool> shapeless) {
  SurfaceMap map(kBytes);
  for (int i = 0; i < 3; ++i)
    map.insert(scan, Pose{});
  const Pose start{Eigen::Quaterniond::Identity(), {0.1, 0.05, 0.0}};
  return Gicp(1).align({.points = scan, .shapeless = shapeless}, map, start, kNoPrior, kOptions, false, never);
}

TEST(Gicp, VoxelsWithoutAPlaneServeWherePlanesAreFew) {
  EXPECT_TRUE(registered(scan_lines_in_a_thicket(), std::nullopt).shapeless);
  EXPECT_FALSE(registered(test::points_on(test::furnished_room(), 3000), std::nullopt).shapeless);
}

TEST(Gicp, VoxelsWithoutAPlaneServeAsTheCallerDecides) {
  EXPECT_TRUE(registered(test::points_on(test::furnished_room(), 3000), true).shapeless);
  const Registration found = registered(scan_lines_in_a_thicket(), false);
  EXPECT_FALSE(found.shapeless);
  EXPECT_EQ(found.inliers, 0U);
  EXPECT_EQ(found.iterations, 0);
}

TEST(Gicp, PlanesAreCounted) {
  const Registration room = registered(test::points_on(test::furnished_room(), 3000), std::nullopt);
  EXPECT_EQ(room.planes, room.inliers);
  const Registration thicket = registered(scan_lines_in_a_thicket(), std::nullopt);
  EXPECT_EQ(thicket.planes, 0U);
  EXPECT_GT(thicket.inliers, thicket.points / 2);
}

TEST(Gicp, WideReachesHalfAMetreAndTenDegrees) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01));
  const Pose truth{so3_exp({0, 0, 10 * kRadPerDeg}), {0.4, -0.3, 0.0}};
  const auto source = test::seen_from(truth, test::points_on(test::furnished_room(), 400, 2, 0.01));
  const Registration found = Gicp(1).align({source}, map, Pose{}, kNoPrior, kOptions, true, never);
  EXPECT_LT(off_m(found.T_target_source, truth), 0.005);
  EXPECT_LT(off_deg(found.T_target_source, truth), 0.1);
}

TEST(Gicp, OutliersAreRejected) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01));
  const Pose truth{so3_exp({0, 0, 0.05}), {0.15, 0.1, 0}};
  auto points = test::points_on(test::furnished_room(), 400, 2, 0.01);
  const auto somebody = test::points_on({{{-2, -3.8, 0}, {0, 0.6, 0}, {0, 0, 1.8}}}, 400, 3); // not in the map
  points.insert(points.end(), somebody.begin(), somebody.end());
  const Registration found =
      Gicp(1).align({test::seen_from(truth, points)}, map, Pose{}, kNoPrior, kOptions, false, never);
  EXPECT_LT(off_m(found.T_target_source, truth), 0.01);
}

TEST(Gicp, TheSameBitsForAnyNumberOfThreads) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.02));
  const auto source =
      test::seen_from({so3_exp({0, 0, 0.1}), {0.2, 0.1, 0}}, test::points_on(test::furnished_room(), 600, 2, 0.02));
  const Registration alone = Gicp(1).align({source}, map, Pose{}, kNoPrior, kOptions, true, never);
  for (const int threads : {1, 2, 4, 8}) {
    Gicp gicp(threads);
    for (int run = 0; run < 10; ++run)
      EXPECT_TRUE(same_bits(gicp.align({source}, map, Pose{}, kNoPrior, kOptions, true, never), alone))
          << threads << " threads";
  }
}

TEST(Gicp, AWeakAxisFallsBackToThePrior) {
  const SurfaceMap map = map_of(test::points_on(test::endless_corridor(), 20'000, 1, 0.01));
  const auto points = test::points_on({{{-10, -1.5, 0}, {20, 0, 0}, {0, 3, 0}},
                                       {{-10, -1.5, 0}, {20, 0, 0}, {0, 0, 3}},
                                       {{-10, 1.5, 0}, {20, 0, 0}, {0, 0, 3}}},
                                      600, 2, 0.01);
  const Pose truth{so3_exp({0, 0, 0.02}), {1.0, 0.05, 0}};
  const MotionBelief prior{
      {Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0}}, Vector6::Zero(), Matrix12::Identity() / (0.05 * 0.05)};
  const Registration found =
      Gicp(1).align({test::seen_from(truth, points)}, map, prior.T_target_source, prior, kOptions, false, never);
  EXPECT_NEAR(found.T_target_source.translation.x(), 1.0, 0.02) << "from the prior";
  EXPECT_NEAR(found.T_target_source.translation.y(), 0.05, 0.005) << "from the walls";
  EXPECT_LT(off_deg(found.T_target_source, truth), 0.1);
  EXPECT_LT(found.observability(0, 0), 0.02);
  EXPECT_GT(found.observability(1, 1), 0.1);
  EXPECT_GT(found.observability(2, 2), 0.1);
}

TEST(Gicp, ARoomIsObservableAllAround) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000));
  const auto source = test::points_on(test::furnished_room(), 400, 2);
  const Registration found = Gicp(1).align({source}, map, Pose{}, kNoPrior, kOptions, false, never);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(found.observability).eigenvalues()[0], 0.02);
  EXPECT_NEAR(found.observability.diagonal().head(3).sum(), 1.0, 1e-6) << "a mean of unit normals";
}

TEST(Gicp, StopEndsTheWorkEarly) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000));
  const auto source =
      test::seen_from({so3_exp({0, 0, 0.1}), {0.3, 0, 0}}, test::points_on(test::furnished_room(), 400, 2));
  int asked = 0;
  const Registration stopped =
      Gicp(1).align({source}, map, Pose{}, kNoPrior, kOptions, false, [&] { return ++asked >= 3; });
  EXPECT_FALSE(stopped.converged);
  EXPECT_GE(stopped.iterations, 1);
  EXPECT_LE(stopped.iterations, 3);
  EXPECT_TRUE(stopped.T_target_source.finite());
}

TEST(Gicp, IterationsAreLimited) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000));
  const auto source =
      test::seen_from({so3_exp({0, 0, 0.1}), {0.3, 0, 0}}, test::points_on(test::furnished_room(), 400, 2));
  const Registration found = Gicp(1).align({source}, map, Pose{}, kNoPrior, {3, 1.0}, false, never);
  EXPECT_EQ(found.iterations, 3);
  EXPECT_FALSE(found.converged);
}

TEST(Gicp, WithoutPointsOrMapTheStartIsTheResult) {
  const SurfaceMap room = map_of(test::points_on(test::furnished_room(), 500));
  const SurfaceMap nothing(kBytes);
  const std::vector<SurfacePoint> points = test::points_on(test::furnished_room(), 100);
  const Pose start{so3_exp({0, 0, 0.3}), {1, 2, 3}};
  Gicp gicp(2);
  for (const bool wide : {false, true}) {
    const Registration no_points = gicp.align({}, room, start, kNoPrior, kOptions, wide, never);
    EXPECT_EQ(no_points.T_target_source, start);
    EXPECT_FALSE(no_points.converged);
    EXPECT_EQ(no_points.inliers, 0U);
    const Registration no_map = gicp.align({points}, nothing, start, kNoPrior, kOptions, wide, never);
    EXPECT_EQ(no_map.T_target_source, start);
    EXPECT_FALSE(no_map.converged);
    EXPECT_EQ(no_map.inliers, 0U);
  }
}

TEST(Gicp, FarFromTheMapTheStartIsTheResult) {
  const SurfaceMap room = map_of(test::points_on(test::furnished_room(), 500));
  const Pose start{Eigen::Quaterniond::Identity(), {1e5, 0, 0}};
  const Registration found =
      Gicp(1).align({test::points_on(test::furnished_room(), 100)}, room, start, kNoPrior, kOptions, true, never);
  EXPECT_EQ(found.T_target_source, start);
}

TEST(Gicp, NonFinitePointsAreIgnored) {
  constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01));
  const Pose truth{so3_exp({0, 0, 0.05}), {0.1, 0.1, 0}};
  auto source = test::seen_from(truth, test::points_on(test::furnished_room(), 400, 2, 0.01));
  source[7].position_m.x() = kNotANumber;
  source[8].position_m = {kInfinity, 0, 0};
  source[9].position_m = {0, -kInfinity, kNotANumber};
  const Registration found = Gicp(1).align({source}, map, Pose{}, kNoPrior, kOptions, false, never);
  EXPECT_LT(off_m(found.T_target_source, truth), 0.01);
}

TEST(Gicp, InformationMatchesTheErrors) {
  const SurfaceMap map = map_of(test::points_on(test::furnished_room(), 5000, 1, 0.0));
  Gicp gicp(1);
  double squared = 0.0, dimensions = 0.0;
  for (unsigned seed = 10; seed < 60; ++seed) {
    const auto source = test::points_on(test::furnished_room(), 200, seed, 0.02);
    const Registration found = gicp.align({source}, map, Pose{}, kNoPrior, kOptions, false, never);
    Vector6 error;
    error << found.T_target_source.translation, so3_log(found.T_target_source.rotation);
    squared += error.dot(found.information.topLeftCorner<6, 6>() * error);
    dimensions += 6.0;
  }
  // 1 if the information is exact. These points are independent, while those of a lidar are not: the registration
  // scales their information by 0.06, and the surfaces' own share of the variance makes it more cautious still.
  EXPECT_LT(squared / dimensions, 2.0 * 0.06 / 0.3);
  EXPECT_GT(squared / dimensions, 0.1 * 0.06 / 0.3);
}

/// Returns twice the negative log likelihood of a mixture of mapped and unmapped points.
double mixture_cost(double points, double mapped, double mean_error) {
  const auto weighed = [&](double part) { return part > 0.0 ? -2.0 * part * std::log(part / points) : 0.0; };
  return mapped * mean_error + 4.2 * (points - mapped) + weighed(mapped) + weighed(points - mapped);
}

/// Returns a registration whose objects are all alike.
Registration fitting(std::size_t inliers, double mean_error = 1.0) {
  Registration registration;
  registration.points = 1000;
  registration.inliers = inliers;
  registration.mean_error = mean_error;
  registration.object_costs.fill(
      static_cast<float>(mixture_cost(1000.0, static_cast<double>(inliers), mean_error) / kObjects));
  return registration;
}

TEST(FitOf, MoreAndNearerPointsFitBetter) {
  EXPECT_GT(fit_of(fitting(900)), fit_of(fitting(800)));
  EXPECT_GT(fit_of(fitting(900, 1.0)), fit_of(fitting(900, 2.0)));
  EXPECT_EQ(fit_of(fitting(0)), 0.0);
}

TEST(FitOf, PointAtThreeSigmaCountsAsNoCorrespondence) {
  EXPECT_EQ(fit_of(fitting(500, 9.0)), fit_of(fitting(0)));
  // 1000 points, half with a residual of 1 and half of 9, are as good as 500 of 1 and 500 without a correspondence.
  EXPECT_DOUBLE_EQ(fit_of(fitting(1000, 5.0)), fit_of(fitting(500, 1.0)));
}

TEST(Evidence, FavoursTheBetterFit) {
  EXPECT_GT(evidence(fitting(900), fitting(800)), 0.0);
  EXPECT_DOUBLE_EQ(evidence(fitting(900), fitting(800)), -evidence(fitting(800), fitting(900)));
  EXPECT_EQ(evidence(fitting(900), fitting(900)), 0.0);
}

TEST(Evidence, ObjectsShareTheCostOfTheMixture) {
  const auto source = test::points_on(test::furnished_room(), 400, 2, 0.01);
  const SurfaceMap whole = map_of(test::points_on(test::furnished_room(), 3000, 1, 0.01)), none(kBytes),
                   floor = map_of(test::points_on({{{-5, -4, 0}, {10, 0, 0}, {0, 8, 0}}}, 3000, 1, 0.01));
  for (const SurfaceMap* map : {&whole, &floor, &none}) {
    const Registration found = Gicp(1).align({source}, *map, Pose{}, kNoPrior, kOptions, false, never);
    const double sum = std::accumulate(found.object_costs.begin(), found.object_costs.end(), 0.0);
    const double expected = mixture_cost(static_cast<double>(source.size()), static_cast<double>(found.inliers),
                                         found.inliers > 0 ? found.mean_error : 0.0);
    EXPECT_NEAR(sum, expected, 1e-4 * expected) << found.inliers;
  }
}

TEST(Evidence, AnObjectIsWorthTheOddsThatItMovedAtMost) {
  const Registration one = fitting(900, 0.3);
  Registration other = one;
  other.object_costs[7] += 1e4F;
  EXPECT_EQ(evidence(one, other), 6.0);
  EXPECT_EQ(evidence(other, one), -6.0);
  other.object_costs[8] += 1e4F;
  EXPECT_EQ(evidence(one, other), 12.0);
}

TEST(Evidence, AnObjectIsWorthNoMoreInSeveralSweeps) {
  const Registration one = fitting(900, 0.3);
  Registration other = one;
  other.object_costs[7] += 25.0F; // of which a fifth counts
  ObjectEvidence sum = compare(one, other);
  EXPECT_NEAR(total(sum), 5.0, 1e-3);
  const ObjectEvidence of_next_sweep = compare(one, other);
  for (std::size_t i = 0; i < kObjects; ++i)
    sum[i] += of_next_sweep[i];
  EXPECT_EQ(total(sum), 6.0);
}

TEST(Evidence, WeighsPointsAsTheRegistrationDoes) {
  // A hundred points more, 4.2 less 1 each, of which 0.06 count as independent. Shares of 0.45 and 0.55 are as likely.
  EXPECT_NEAR(evidence(fitting(550, 1.0), fitting(450, 1.0)), 0.06 * 100.0 * 3.2, 1e-3);
  // Surfaces that fit as well as is possible.
  EXPECT_NEAR(evidence(fitting(900, 0.3), fitting(900, 0.4)), 0.06 / 0.3 * 900.0 * 0.1, 1e-3);
  EXPECT_NEAR(evidence(fitting(900, 0.1), fitting(900, 0.2)), 0.06 / 0.3 * 900.0 * 0.1, 1e-3);
}

TEST(Evidence, SlidingBackOntoASparseMapGainsNothing) {
  EXPECT_GT(evidence(fitting(900), fitting(800)), 10.0);
  EXPECT_LT(evidence(fitting(200), fitting(100)), 0.0);
  EXPECT_LT(evidence(fitting(100), fitting(0)), 0.0);
}

TEST(Evidence, BadFitLowersTheWeightOfADifference) {
  EXPECT_NEAR(evidence(fitting(900, 3.0), fitting(900, 3.5)), evidence(fitting(900, 1.0), fitting(900, 1.5)) / 3.0,
              1e-3);
}

} // namespace
} // namespace locus
