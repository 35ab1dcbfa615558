// SPDX-License-Identifier: Apache-2.0
#include "core/map/correspondences.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "core/surfaces.hpp"

namespace locus {
namespace {

constexpr std::size_t kMapBytes = 20'000'000;
constexpr double kGate_m = 1.0;

/// Floor at height zero, 9 x 9 m around the origin.
SurfaceMap floor_map() {
  SurfaceMap map(kMapBytes);
  map.insert(test::points_on({{{-4.5, -4.5, 0}, {9, 0, 0}, {0, 9, 0}}}, 20'000), Pose{});
  return map;
}

SourceBlock block_of(const std::vector<Eigen::Vector3f>& positions_m) {
  std::vector<SurfacePoint> points;
  for (const Eigen::Vector3f& position_m : positions_m)
    points.push_back({position_m, Eigen::Vector3f::Zero()});
  return SourceBlock(points);
}

GicpPass pass_in(const SurfaceMap& map, LookUp look_up = LookUp::here) {
  return {.target = map,
          .T_target_source = Pose{},
          .origin_m = Eigen::Vector3d::Zero(),
          .look_up = look_up,
          .accepts_shapeless = false,
          .max_correspondence_m = kGate_m,
          .width2 = 144.0};
}

MatchBlock matches_of(const GicpPass& pass, const SourceBlock& source) {
  MatchBlock matches;
  find(pass, source, matches, Isa::baseline);
  return matches;
}

TEST(Correspondences, PointNearAPlaneIsMatchedWithIt) {
  const SurfaceMap map = floor_map();
  const MatchBlock matches = matches_of(pass_in(map), block_of({{0.1F, 0.1F, 0.2F}}));
  EXPECT_EQ(matches.found[0], 1.0F);
  EXPECT_NEAR(matches.z_m[0], 0.0, 0.01) << "mean of the surface";
  EXPECT_NEAR(std::abs(matches.normal_z[0]), 1.0, 0.01);
  EXPECT_EQ(matches.tilt_rad2[0], map.fine().find({0, 0, 0})->tilt_rad2);
}

TEST(Correspondences, PoseMovesThePoints) {
  const SurfaceMap map = floor_map();
  GicpPass pass = pass_in(map);
  pass.T_target_source = {so3_exp({0, 0, 1.0}), {0.0, 0.0, -5.0}};
  EXPECT_EQ(matches_of(pass, block_of({{0, 0, 5.0F}})).found[0], 1.0F);
  EXPECT_EQ(matches_of(pass, block_of({{0, 0, 0.0F}})).found[0], 0.0F);
}

/// Fine voxels are 0.5 m, coarse ones 1.5 m, both centred on the floor.
TEST(Correspondences, CoarseVoxelServesWhereTheFineOneIsEmpty) {
  const SurfaceMap map = floor_map();
  const MatchBlock matches = matches_of(pass_in(map), block_of({{0, 0, 0.6F}, {0, 0, 0.9F}}));
  EXPECT_EQ(matches.found[0], 1.0F) << "in the coarse voxel of the floor";
  EXPECT_EQ(matches.found[1], 0.0F) << "above it";
}

TEST(Correspondences, GateIsTheDistanceAcrossThePlane) {
  const SurfaceMap map = floor_map();
  GicpPass pass = pass_in(map);
  pass.max_correspondence_m = 0.15;
  const MatchBlock matches = matches_of(pass, block_of({{0.24F, 0.24F, 0.1F}, {0, 0, 0.2F}}));
  EXPECT_EQ(matches.found[0], 1.0F) << "a third of a metre from the mean, along the plane";
  EXPECT_EQ(matches.found[1], 0.0F);
}

TEST(Correspondences, FollowRetainsTheMatchWithinAVoxelOnly) {
  const SurfaceMap map = floor_map();
  MatchBlock matches = matches_of(pass_in(map), block_of({{0, 0, 0.1F}, {0, 0, 0.1F}}));
  const SurfaceMap nothing(kMapBytes);
  find(pass_in(nothing, LookUp::follow), block_of({{0.1F, 0, 0.2F}, {0, 0, 0.4F}}), matches, Isa::baseline);
  EXPECT_EQ(matches.found[0], 1.0F) << "in the same voxel";
  EXPECT_EQ(matches.found[1], 0.0F) << "in the next one, which is looked up";
}

TEST(Correspondences, HereLooksUpEveryPoint) {
  const SurfaceMap map = floor_map();
  MatchBlock matches = matches_of(pass_in(map), block_of({{0, 0, 0.1F}}));
  const SurfaceMap nothing(kMapBytes);
  find(pass_in(nothing), block_of({{0, 0, 0.1F}}), matches, Isa::baseline);
  EXPECT_EQ(matches.found[0], 0.0F);
}

TEST(Correspondences, AroundReachesTheNextVoxel) {
  const SurfaceMap map = floor_map();
  const SourceBlock source = block_of({{0, 0, 1.2F}, {0, 0, 1.8F}});
  EXPECT_EQ(matches_of(pass_in(map), source).found[0], 0.0F);
  const MatchBlock matches = matches_of(pass_in(map, LookUp::around), source);
  EXPECT_EQ(matches.found[0], 1.0F);
  EXPECT_NEAR(matches.z_m[0], 0.0, 0.01);
  EXPECT_EQ(matches.found[1], 0.0F) << "more than a coarse voxel away";
}

TEST(Correspondences, AroundFindsTheNearestSurface) {
  SurfaceMap map(kMapBytes);
  map.insert(
      test::points_on({{{-4.5, -4.5, 0}, {9, 0, 0}, {0, 9, 0}}, {{-4.5, -4.5, 3}, {9, 0, 0}, {0, 9, 0}}}, 20'000),
      Pose{});
  const MatchBlock matches = matches_of(pass_in(map, LookUp::around), block_of({{0, 0, 1.2F}, {0, 0, 1.8F}}));
  EXPECT_NEAR(matches.z_m[0], 0.0, 0.01);
  EXPECT_NEAR(matches.z_m[1], 3.0, 0.01);
}

/// A cluster of points without a plane in the voxel around the origin, in a map of `sweeps` sweeps.
SurfaceMap thicket(int sweeps) {
  std::mt19937 random{7};
  std::uniform_real_distribution<float> unit{-0.1F, 0.1F};
  std::vector<SurfacePoint> points;
  for (int i = 0; i < 12; ++i)
    points.push_back({{unit(random), unit(random), unit(random)}, Eigen::Vector3f::Zero()});
  SurfaceMap map(kMapBytes);
  for (int i = 0; i < sweeps; ++i)
    map.insert(points, Pose{});
  return map;
}

TEST(Correspondences, ShapelessVoxelsServeOnlyIfAccepted) {
  const SurfaceMap map = thicket(3);
  GicpPass pass = pass_in(map);
  const SourceBlock source = block_of({{0.05F, 0, 0}});
  EXPECT_EQ(matches_of(pass, source).found[0], 0.0F);
  pass.accepts_shapeless = true;
  const MatchBlock matches = matches_of(pass, source);
  EXPECT_EQ(matches.found[0], 1.0F);
  EXPECT_EQ(matches.tilt_rad2[0], 0.0F) << "a ball";
  EXPECT_EQ(matches.normal_x[0] + matches.normal_y[0] + matches.normal_z[0], 0.0F);
  EXPECT_EQ(matches.unknown[0], 0.0F);
}

/// The points of one sweep lie where its scan lines fell.
TEST(Correspondences, ShapeOfOneSweepIsUnknown) {
  const SurfaceMap map = thicket(1);
  GicpPass pass = pass_in(map);
  pass.accepts_shapeless = true;
  const MatchBlock matches = matches_of(pass, block_of({{0.05F, 0, 0}, {3, 0, 0}}));
  EXPECT_EQ(matches.found[0], 0.0F);
  EXPECT_EQ(matches.unknown[0], 1.0F);
  EXPECT_EQ(matches.unknown[1], 0.0F) << "empty space";
}

TEST(Correspondences, OriginOfTheCoordinatesIsArbitrary) {
  const SurfaceMap map = floor_map();
  GicpPass pass = pass_in(map);
  const SourceBlock source = block_of({{1.1F, -2.2F, 0.2F}});
  const MatchBlock near = matches_of(pass, source);
  pass.origin_m = {100.3, -50.2, 7.1};
  const MatchBlock far = matches_of(pass, source);
  EXPECT_EQ(far.found[0], 1.0F);
  EXPECT_NEAR(static_cast<double>(far.x_m[0]) + 100.3, near.x_m[0], 1e-4);
  EXPECT_NEAR(static_cast<double>(far.y_m[0]) - 50.2, near.y_m[0], 1e-4);
  EXPECT_NEAR(static_cast<double>(far.z_m[0]) + 7.1, near.z_m[0], 1e-4);
}

TEST(Correspondences, PointsOutOfReachHaveNone) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  const SurfaceMap map = floor_map();
  for (const LookUp look_up : {LookUp::here, LookUp::follow, LookUp::around}) {
    MatchBlock matches = matches_of(pass_in(map), block_of({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}));
    find(pass_in(map, look_up), block_of({{kNan, 0, 0}, {0, kInfinity, 0}, {1e9F, 0, 0}, {0, 0, 0.1F}}), matches,
         Isa::baseline);
    EXPECT_EQ(matches.found[0] + matches.found[1] + matches.found[2], 0.0F);
    EXPECT_EQ(matches.found[3], 1.0F);
  }
}

/// The kernel runs over whole blocks.
TEST(Correspondences, EntriesBeyondTheLastPointHaveNone) {
  const SurfaceMap map = floor_map();
  MatchBlock matches = matches_of(pass_in(map), block_of(std::vector<Eigen::Vector3f>(kGicpBlock, {0, 0, 0.1F})));
  find(pass_in(map), block_of({{0, 0, 0.1F}}), matches, Isa::baseline);
  EXPECT_EQ(matches.found[0], 1.0F);
  for (std::size_t i = 1; i < kGicpBlock; ++i)
    ASSERT_EQ(matches.found[i] + matches.unknown[i], 0.0F) << i;
}

TEST(Correspondences, AreTheSameForEveryInstructionSet) {
  const SurfaceMap map = floor_map();
  const auto points = test::points_on({{{-4, -4, 0}, {8, 0, 0}, {0, 8, 0.5}}}, kGicpBlock, 3);
  const SourceBlock source(points);
  const MatchBlock expected = matches_of(pass_in(map), source);
  for (const Isa isa : {Isa::avx2, Isa::avx512}) {
    if (!is_supported(isa))
      continue;
    MatchBlock matches;
    find(pass_in(map), source, matches, isa);
    EXPECT_EQ(matches.found, expected.found);
    EXPECT_EQ(matches.normal_z, expected.normal_z);
  }
}

/// A point of age a, de-skewed for the scan's twist s, is at exp(-a x) exp(a s) of where it was, for the twist x.
TEST(SourceBlock, PointsMoveWithTheTwistByTheirOwnAges) {
  const Vector6 of_scan = (Vector6() << 1.0, 0.2, 0.0, 0.1, -0.2, 0.3).finished();
  const Vector6 found = of_scan + (Vector6() << -0.4, 0.3, 0.1, 0.1, 0.2, -1.0).finished();
  const std::vector<float> ages_s{0.040F, 0.044F, 0.047F, 0.053F};
  const std::vector<Eigen::Vector3f> positions_m{{8, 3, -1}, {-5, 6, 2}, {0, -9, 1}, {2, 2, 0}};
  std::vector<SurfacePoint> points;
  for (const Eigen::Vector3f& position_m : positions_m)
    points.push_back({position_m, Eigen::Vector3f::Zero()});
  SourceBlock block(points, ages_s);
  EXPECT_NEAR(block.age_s, 0.046, 1e-6);
  block.deskew(found - of_scan);
  const auto shift = [&](double age_s) { return se3_exp(-age_s * found) * se3_exp(age_s * of_scan); };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d moved_m{static_cast<double>(block.x_m[i]), static_cast<double>(block.y_m[i]),
                                  static_cast<double>(block.z_m[i])};
    const Eigen::Vector3d scan_m = positions_m[i].cast<double>();
    const double change_m = (shift(static_cast<double>(ages_s[i])) * scan_m - shift(block.age_s) * scan_m).norm();
    EXPECT_LT((shift(block.age_s) * moved_m - shift(static_cast<double>(ages_s[i])) * scan_m).norm(), 0.1 * change_m);
  }
  block.deskew(Vector6::Zero());
  EXPECT_EQ(block.x_m[0], 8.0F) << "moved from where the scan has it, not from the last place";
}

} // namespace
} // namespace locus
