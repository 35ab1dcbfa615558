// SPDX-License-Identifier: Apache-2.0
#include "core/map/surface_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/surfaces.hpp"

namespace locus {
namespace {

constexpr std::size_t kLimit_bytes = 20'000'000;

TEST(SurfaceMap, SweepIsInsertedAtItsPose) {
  SurfaceMap map(kLimit_bytes);
  const Pose T_map_base{so3_exp({0, 0, 1.0}), {30, -20, 1}};
  map.insert(test::seen_from(T_map_base, test::points_on({{{10, 10, 2}, {2, 0, 0}, {0, 2, 0}}}, 1000)), T_map_base);
  const SurfaceGrid& fine = map.fine();
  const Surface* surface = fine.find(fine.index_of({11, 11, 2}));
  ASSERT_NE(surface, nullptr);
  EXPECT_TRUE(surface->planar());
  EXPECT_GT(std::abs(surface->normal.z()), 0.999F);
  EXPECT_NE(map.coarse().find(map.coarse().index_of({11, 11, 2})), nullptr);
}

TEST(SurfaceMap, TheFineGridIsFinerThanTheCoarse) {
  SurfaceMap map(kLimit_bytes);
  map.insert(test::points_on({{{0, 0, 0}, {20, 0, 0}, {0, 20, 0}}}, 20'000), Pose{});
  EXPECT_GT(map.fine().size(), 7 * map.coarse().size());
}

TEST(SurfaceMap, AFineVoxelLiesInOneCoarseOne) {
  const SurfaceMap map(kLimit_bytes);
  std::mt19937 random{1};
  std::uniform_real_distribution<double> within{-20.0, 20.0};
  for (int i = 0; i < 10000; ++i) {
    const Eigen::Vector3d p{within(random), within(random), within(random)};
    ASSERT_EQ(SurfaceMap::coarse_of(map.fine().index_of(p)), map.coarse().index_of(p)) << p.transpose();
  }
}

TEST(SurfaceMap, TheSameSweepAgainMakesNoNewVoxels) {
  SurfaceMap map(kLimit_bytes);
  const auto points = test::points_on(test::furnished_room(), 2000);
  map.insert(points, Pose{});
  const std::size_t size = map.fine().size();
  map.insert(points, Pose{});
  EXPECT_EQ(map.fine().size(), size);
}

TEST(SurfaceMap, NeverHoldsMoreThanItsBudget) {
  constexpr std::size_t kSmall = 1'000'000;
  SurfaceMap map(kSmall);
  for (int i = 0; i < 50; ++i)
    map.insert(test::points_on(test::furnished_room(), 2000), Pose{Eigen::Quaterniond::Identity(), {20.0 * i, 0, 0}});
  EXPECT_LE(map.fine().size(), map.fine().capacity());
  EXPECT_GT(map.fine().evicted(), 0U);
  constexpr std::size_t kLeastBytesOfAVoxel = 64;
  EXPECT_LT((map.fine().capacity() + map.coarse().capacity()) * kLeastBytesOfAVoxel, kSmall);
}

TEST(SurfaceMap, ClearedIsEmpty) {
  SurfaceMap map(kLimit_bytes);
  map.insert(test::points_on(test::furnished_room(), 500), Pose{});
  map.clear();
  EXPECT_EQ(map.fine().size(), 0U);
  EXPECT_EQ(map.coarse().size(), 0U);
}

} // namespace
} // namespace locus
