// SPDX-License-Identifier: Apache-2.0
// Registration of pose and twist together: points of different ages.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

#include "core/map/registration.hpp"
#include "core/surfaces.hpp"

namespace locus {
namespace {

constexpr std::size_t kBlocks = 8;
const Pose kTrueEnd{so3_exp({0.02, -0.03, 0.4}), {0.1, -0.1, 0.05}};
const Vector6 kTrueTwist = (Vector6() << 1.0, -0.2, 0.1, 0.1, -0.1, 0.5).finished();

SurfaceMap map_of_a_room() {
  SurfaceMap map(20'000'000);
  map.insert(test::points_on(test::furnished_room(), 5000), Pose{});
  return map;
}

/// A sweep through the room, recorded by a base that moved with kTrueTwist and ended at kTrueEnd, in blocks of these
/// ages. Its points are de-skewed for `assumed`.
struct SweepOfARoom {
  std::vector<SurfacePoint> points;
  std::vector<float> ages_s;
  Vector6 assumed;

  SweepOfARoom(const std::vector<float>& of_blocks_s, const Vector6& with_twist, unsigned seed = 2)
      : assumed(with_twist) {
    std::vector<SurfacePoint> all = test::points_on(test::furnished_room(), 400, seed, 0.005);
    std::shuffle(all.begin(), all.end(), std::mt19937{seed}); // each block sees the whole room
    for (std::size_t block = 0; block < of_blocks_s.size(); ++block) {
      ages_s.insert(ages_s.end(), kGicpBlock, of_blocks_s[block]);
      const auto age_s = static_cast<double>(of_blocks_s[block]);
      const Pose T_room_then = kTrueEnd * se3_exp(-age_s * kTrueTwist);
      const auto first = all.begin() + static_cast<std::ptrdiff_t>(block * kGicpBlock);
      const std::vector<SurfacePoint> then = test::seen_from(T_room_then, {first, first + std::ptrdiff_t{kGicpBlock}});
      // A point of that age is de-skewed by the motion from then to the end of the sweep.
      for (const SurfacePoint& point : test::seen_from(se3_exp(age_s * assumed), then))
        points.push_back(point);
    }
  }
  [[nodiscard]] ElasticScan scan() const { return {points, ages_s, assumed}; }
};

std::vector<float> spread_over(float period_s) {
  std::vector<float> ages_s;
  for (std::size_t block = 0; block < kBlocks; ++block)
    ages_s.push_back(period_s * (static_cast<float>(block) + 0.5F) / static_cast<float>(kBlocks));
  return ages_s;
}

/// Registers from the truth at the assumed twist, which the prior does not hold.
Registration registered(const SweepOfARoom& sweep, const SurfaceMap& map, const MotionBelief& prior = {}) {
  return Gicp(1).align(sweep.scan(), map, kTrueEnd, prior, {20, 1.0}, false, [] { return false; });
}

TEST(ElasticRegistration, FindsTheTwistWithinASweep) {
  const SurfaceMap map = map_of_a_room();
  for (unsigned seed = 2; seed < 7; ++seed) {
    const Vector6 assumed = kTrueTwist + (Vector6() << 0.4, -0.3, 0.2, -0.1, 0.15, 0.2).finished();
    const Registration found = registered(SweepOfARoom(spread_over(0.1F), assumed, seed), map);
    EXPECT_LT((found.twist_base - kTrueTwist).head<3>().norm(), 0.06) << "m/s, of 0.54";
    EXPECT_LT((found.twist_base - kTrueTwist).tail<3>().norm(), 0.03) << "rad/s, of 0.27";
    EXPECT_LT((found.T_target_source.translation - kTrueEnd.translation).norm(), 0.005);
  }
}

/// Points of one age a measure T exp(-a twist): information I of the pose is -a I R for pose and twist, and
/// a² R' I R for the twist (target axes and base axes).
TEST(ElasticRegistration, InformationOfTheTwistFollowsFromTheAge) {
  const SurfaceMap map = map_of_a_room();
  constexpr double kAge_s = 0.07;
  MotionBelief prior{kTrueEnd, kTrueTwist, Matrix12::Zero()}; // they do not determine the twist
  prior.information.bottomRightCorner<6, 6>() = 1e6 * Matrix6::Identity();
  const Registration found = registered(SweepOfARoom(std::vector<float>(kBlocks, 0.07F), kTrueTwist), map, prior);
  const Matrix6 R = turn_both(found.T_target_source.rotation), pose = found.information.topLeftCorner<6, 6>();
  const Matrix6 across = found.information.topRightCorner<6, 6>(), twist = found.information.bottomRightCorner<6, 6>();
  EXPECT_GT(pose.norm(), 0.0);
  EXPECT_LT((across + kAge_s * pose * R).norm(), 2e-3 * across.norm());
  EXPECT_LT((twist - kAge_s * kAge_s * R.transpose() * pose * R).norm(), 2e-3 * twist.norm());
}

TEST(ElasticRegistration, LongerSweepsDetermineTheTwistBetter) {
  const SurfaceMap map = map_of_a_room();
  const auto variance_of_twist = [&](float period_s) {
    const Matrix12 information = registered(SweepOfARoom(spread_over(period_s), kTrueTwist), map).information;
    return Matrix12{information.inverse()}.diagonal().tail<6>().eval();
  };
  const Vector6 ratio = variance_of_twist(0.05F).cwiseQuotient(variance_of_twist(0.1F));
  for (int axis = 0; axis < 6; ++axis)
    EXPECT_NEAR(ratio[axis], 4.0, 1.0) << axis;
}

TEST(ElasticRegistration, InformationIsSymmetricAndNotNegative) {
  const SurfaceMap map = map_of_a_room();
  const Matrix12 information = registered(SweepOfARoom(spread_over(0.1F), kTrueTwist), map).information;
  EXPECT_LT((information - information.transpose()).norm(), 1e-9 * information.norm());
  EXPECT_TRUE((Matrix12::Identity() + information).llt().info() == Eigen::Success);
}

TEST(ElasticRegistration, PointsWithoutAgeLeaveTheTwistToThePrior) {
  const SurfaceMap map = map_of_a_room();
  const SweepOfARoom sweep(std::vector<float>(kBlocks, 0.0F), Vector6::Zero());
  MotionBelief prior{kTrueEnd, kTrueTwist, Matrix12::Zero()};
  prior.information.bottomRightCorner<6, 6>().setIdentity();
  const Registration found = registered(sweep, map, prior);
  EXPECT_LT((found.twist_base - kTrueTwist).norm(), 1e-4);
  EXPECT_EQ(found.information.bottomRows<6>().norm(), 0.0);
  EXPECT_GT((found.information.topLeftCorner<6, 6>().norm()), 0.0);
}

/// The prior and the points are fused by their information.
TEST(ElasticRegistration, CertainPriorHoldsTheTwist) {
  const SurfaceMap map = map_of_a_room();
  const Vector6 assumed = kTrueTwist + (Vector6() << 0.4, 0, 0, 0, 0, 0).finished();
  MotionBelief prior{kTrueEnd, assumed, Matrix12::Zero()};
  prior.information.bottomRightCorner<6, 6>() = 1e9 * Matrix6::Identity();
  const Registration found = registered(SweepOfARoom(spread_over(0.1F), assumed), map, prior);
  EXPECT_LT((found.twist_base - assumed).norm(), 0.002);
}

} // namespace
} // namespace locus
