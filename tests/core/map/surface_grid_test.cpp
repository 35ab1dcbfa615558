// SPDX-License-Identifier: Apache-2.0
#include "core/map/surface_grid.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace locus {
namespace {

constexpr double kLeaf_m = 0.5;
constexpr std::size_t kEnoughBytes = 10'000'000;
const Eigen::Vector3f kNoNormal = Eigen::Vector3f::Zero();

void insert(SurfaceGrid& grid, const Eigen::Vector3d& point_m, const Eigen::Vector3f& normal) {
  SurfaceGrid::Points points;
  points.x_m[0] = point_m.x();
  points.y_m[0] = point_m.y();
  points.z_m[0] = point_m.z();
  points.normal_x[0] = normal.x();
  points.normal_y[0] = normal.y();
  points.normal_z[0] = normal.z();
  points.count = 1;
  grid.insert(points);
}

/// Inserts one point in the middle of each voxel of a line along x.
void insert_voxels_along_x(SurfaceGrid& grid, int from, int to) {
  for (int i = from; i < to; ++i)
    insert(grid, {kLeaf_m * i, 0, 0}, kNoNormal);
  grid.refresh();
}

bool has_voxel_along_x(const SurfaceGrid& grid, int i) { return grid.find({i, 0, 0}) != nullptr; }

TEST(SurfaceGrid, FindsInsertedPoints) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  const Eigen::Vector3d p{3.1, -2.2, 0.7};
  EXPECT_EQ(grid.find(grid.index_of(p)), nullptr);
  insert(grid, p, Eigen::Vector3f::UnitX());
  grid.refresh();
  const Surface* surface = grid.find(grid.index_of(p));
  ASSERT_NE(surface, nullptr);
  EXPECT_EQ(grid.size(), 1U);
  EXPECT_LT((grid.centre_of(grid.index_of(p)) + surface->mean_m.cast<double>() - p).norm(), 1e-6);
  EXPECT_EQ(grid.find({0, 0, 0}), nullptr);
}

TEST(SurfaceGrid, IndexIsThatOfTheNearestCentre) {
  const SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  EXPECT_EQ(grid.index_of({0.24, -0.24, 0.0}), (VoxelIndex{0, 0, 0}));
  EXPECT_EQ(grid.index_of({0.26, -0.26, 0.0}), (VoxelIndex{1, -1, 0}));
  EXPECT_EQ(grid.centre_of({2, -3, 0}), Eigen::Vector3d(1.0, -1.5, 0.0));
}

TEST(SurfaceGrid, PointWithNormalIsPlanar) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  const Eigen::Vector3f normal = Eigen::Vector3f{1, 2, 2}.normalized();
  insert(grid, {0.1, 0.1, 0.1}, normal);
  grid.refresh();
  const Surface* surface = grid.find({0, 0, 0});
  ASSERT_TRUE(surface->planar());
  EXPECT_NEAR(std::abs(surface->normal.dot(normal)), 1.0F, 1e-5F);
}

TEST(SurfaceGrid, PointWithoutNormalIsNotPlanar) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  insert(grid, {0.1, 0.1, 0.1}, kNoNormal);
  grid.refresh();
  EXPECT_FALSE(grid.find({0, 0, 0})->planar());
}

TEST(SurfaceGrid, ScanLineIsNotPlanar) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  std::mt19937 random{1};
  std::normal_distribution<double> noise{0.0, 0.01};
  for (int i = -20; i <= 20; ++i)
    insert(grid, {0.01 * i, noise(random), noise(random)}, kNoNormal);
  grid.refresh();
  ASSERT_EQ(grid.size(), 1U);
  EXPECT_FALSE(grid.find({0, 0, 0})->planar());
}

TEST(SurfaceGrid, CornerIsNotPlanar) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  std::mt19937 random{1};
  std::uniform_real_distribution<double> along{-0.24, 0.24};
  for (int i = 0; i < 100; ++i) {
    insert(grid, {-0.1, along(random), along(random)}, Eigen::Vector3f::UnitX());
    insert(grid, {along(random), -0.1, along(random)}, Eigen::Vector3f::UnitY());
  }
  grid.refresh();
  EXPECT_FALSE(grid.find({0, 0, 0})->planar());
}

/// Four points along a line across a voxel, as a scan line leaves them.
void insert_scan_line(SurfaceGrid& grid, double y_m) {
  for (const double x_m : {-0.2, -0.1, 0.1, 0.2})
    insert(grid, {x_m, y_m, 0.0}, kNoNormal);
  grid.refresh();
}

TEST(SurfaceGrid, ShapeIsUnknownFromOneSweep) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  insert_scan_line(grid, 0.0);
  EXPECT_TRUE(grid.find({0, 0, 0})->unknown());
  EXPECT_FALSE(grid.find({0, 0, 0})->shapeless());
  insert(grid, {0.0, 0.1, 0.1}, kNoNormal); // of another sweep
  grid.refresh();
  EXPECT_FALSE(grid.find({0, 0, 0})->unknown());
  EXPECT_TRUE(grid.find({0, 0, 0})->shapeless());
}

TEST(SurfaceGrid, TooFewPointsHaveNoShapeHoweverManySweepsTheyAreOf) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  for (const double y_m : {-0.1, 0.0, 0.1}) {
    insert(grid, {0.0, y_m, 0.0}, kNoNormal);
    grid.refresh();
    EXPECT_FALSE(grid.find({0, 0, 0})->unknown());
    EXPECT_FALSE(grid.find({0, 0, 0})->shapeless());
  }
}

TEST(SurfaceGrid, PointOfAShapelessVoxelMayLieAnywhereInIt) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  insert_scan_line(grid, 0.0);
  insert_scan_line(grid, 0.0);
  EXPECT_GE(grid.find({0, 0, 0})->strewn_m2, kLeaf_m * kLeaf_m / 12.0);
}

TEST(SurfaceGrid, ANoisyFloorAtHeightZeroIsOneLayerOfPlanes) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  std::mt19937 random{1};
  std::uniform_real_distribution<double> along{-1.74, 1.74};
  std::normal_distribution<double> noise{0.0, 0.02};
  for (int i = 0; i < 5000; ++i)
    insert(grid, {along(random), along(random), noise(random)}, Eigen::Vector3f::UnitZ());
  grid.refresh();
  EXPECT_EQ(grid.size(), 49U) << "7 x 7 voxels, one above the other none";
  for (std::size_t slot = 0; slot < grid.size(); ++slot) {
    ASSERT_TRUE(grid.surface(slot).planar());
    EXPECT_GT(std::abs(grid.surface(slot).normal.z()), 0.99F);
    EXPECT_NEAR(grid.surface(slot).mean_m.z(), 0.0, 0.01);
    EXPECT_NEAR(std::sqrt(grid.surface(slot).variance_m2), 0.02, 0.005);
  }
}

/// Returns the mean square of the normal's tilt about an axis over many floors of `count` noisy points each, and the
/// mean of its variance as the voxels have it.
std::pair<double, double> tilts_of_noisy_floors(int count) {
  std::mt19937 random{3};
  std::uniform_real_distribution<double> along{-0.24, 0.24};
  std::normal_distribution<double> noise{0.0, 0.02};
  double tilts_rad2 = 0.0, expected_rad2 = 0.0;
  int planes = 0;
  for (int floor = 0; floor < 400; ++floor) {
    SurfaceGrid grid(kLeaf_m, 100'000);
    for (int i = 0; i < count; ++i)
      insert(grid, {along(random), along(random), noise(random)}, kNoNormal);
    grid.refresh();
    const Surface& surface = *grid.find({0, 0, 0});
    if (!surface.planar())
      continue;
    ++planes;
    tilts_rad2 += static_cast<double>(surface.normal.head<2>().squaredNorm()) / 2.0;
    expected_rad2 += static_cast<double>(surface.tilt_rad2);
  }
  EXPECT_GT(planes, 350);
  return {tilts_rad2 / planes, expected_rad2 / planes};
}

TEST(SurfaceGrid, NormalIsAsUncertainAsItsPointsSay) {
  for (const int count : {12, 100}) {
    const auto [tilts_rad2, expected_rad2] = tilts_of_noisy_floors(count);
    EXPECT_GT(expected_rad2, tilts_rad2 / 1.5) << count;
    EXPECT_LT(expected_rad2, tilts_rad2 * 1.5) << count;
  }
}

TEST(SurfaceGrid, PlanesAreReadAllOrThoseWithinARadius) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  insert(grid, {0, 0, 0.1}, Eigen::Vector3f::UnitZ());
  insert(grid, {10, 0, 0.1}, Eigen::Vector3f::UnitZ());
  insert(grid, {20, 0, 0.1}, kNoNormal);
  grid.refresh();
  std::vector<SurfacePoint> planes(7);
  read_planes(grid, planes);
  ASSERT_EQ(planes.size(), 2U) << "and no more of what was there before";
  read_planes(grid, planes, {9, 0, 0}, 5.0);
  ASSERT_EQ(planes.size(), 1U);
  EXPECT_TRUE(planes[0].position_m.isApprox(Eigen::Vector3f{10, 0, 0.1F}));
  EXPECT_EQ(planes[0].normal, Eigen::Vector3f::UnitZ());
}

TEST(SurfaceGrid, LongStayDoesNotFreezeAVoxel) {
  SurfaceGrid grid(kLeaf_m, kEnoughBytes);
  for (int i = 0; i < 20'000; ++i)
    insert(grid, {0, 0, 0}, Eigen::Vector3f::UnitZ());
  for (int i = 0; i < 2000; ++i)
    insert(grid, {0, 0, 0.1}, Eigen::Vector3f::UnitZ());
  grid.refresh();
  EXPECT_NEAR(grid.find({0, 0, 0})->mean_m.z(), 0.1, 0.01);
}

TEST(SurfaceGrid, AFullGridEvictsTheOldest) {
  SurfaceGrid grid(kLeaf_m, 20'000);
  const int capacity = static_cast<int>(grid.capacity());
  ASSERT_LT(capacity, 1000);
  insert_voxels_along_x(grid, 0, capacity);
  EXPECT_EQ(grid.evicted(), 0U);
  insert_voxels_along_x(grid, capacity, capacity + 10);
  EXPECT_EQ(grid.evicted(), 10U);
  EXPECT_EQ(grid.size(), grid.capacity());
  for (int i = 0; i < 10; ++i)
    EXPECT_FALSE(has_voxel_along_x(grid, i));
  for (int i = 10; i < capacity + 10; ++i)
    EXPECT_TRUE(has_voxel_along_x(grid, i));
}

TEST(SurfaceGrid, StoredVoxelsAreFoundAfterManyEvictions) {
  SurfaceGrid grid(kLeaf_m, 20'000);
  std::mt19937 random{1};
  std::uniform_int_distribution<int> cell{-20, 20};
  for (int i = 0; i < 50'000; ++i) {
    insert(grid, kLeaf_m * Eigen::Vector3d(cell(random), cell(random), cell(random)), kNoNormal);
    if (i % 1000 == 0)
      grid.refresh();
  }
  grid.refresh();
  EXPECT_EQ(grid.size(), grid.capacity());
  EXPECT_GT(grid.evicted(), 10'000U);
  for (std::size_t slot = 0; slot < grid.size(); ++slot)
    ASSERT_EQ(grid.find(grid.index_of(grid.centre(slot))), &grid.surface(slot));
}

TEST(SurfaceGrid, VoxelsNearTheRobotAreNotEvicted) {
  SurfaceGrid grid(kLeaf_m, 20'000);
  const int capacity = static_cast<int>(grid.capacity());
  grid.protect({0, 0, 0}, 10.1 * kLeaf_m);
  insert_voxels_along_x(grid, 0, 2 * capacity);
  for (int i = 0; i <= 10; ++i)
    EXPECT_TRUE(has_voxel_along_x(grid, i));
}

TEST(SurfaceGrid, ProtectingEverythingDoesNotStopEviction) {
  SurfaceGrid grid(kLeaf_m, 20'000);
  grid.protect({0, 0, 0}, 1e9);
  const int capacity = static_cast<int>(grid.capacity());
  insert_voxels_along_x(grid, 0, 3 * capacity);
  EXPECT_EQ(grid.size(), grid.capacity());
  EXPECT_TRUE(has_voxel_along_x(grid, 3 * capacity - 1));
}

TEST(SurfaceGrid, WholeMapInsertedAtOnceFitsTheSmallestBudget) {
  SurfaceGrid grid(kLeaf_m, 1);
  EXPECT_GT(grid.capacity(), 0U);
  for (int i = 0; i < 10'000; ++i) // without a refresh in between
    insert(grid, {kLeaf_m * i, 0, 0}, kNoNormal);
  grid.refresh();
  EXPECT_EQ(grid.size(), grid.capacity());
}

TEST(SurfaceGrid, ClearedIsEmptyAndUsable) {
  SurfaceGrid grid(kLeaf_m, 20'000);
  insert_voxels_along_x(grid, 0, 1000);
  grid.clear();
  EXPECT_EQ(grid.size(), 0U);
  for (int i = 0; i < 1000; ++i)
    ASSERT_FALSE(has_voxel_along_x(grid, i));
  insert_voxels_along_x(grid, 0, 10);
  EXPECT_EQ(grid.size(), 10U);
  EXPECT_TRUE(has_voxel_along_x(grid, 9));
}

} // namespace
} // namespace locus
