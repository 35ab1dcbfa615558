// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/point_filters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace locus {
namespace {

SweepPoint point(float x, float y, float z, float age_s = 0.0F, float intensity = 0.0F) {
  return {{x, y, z}, Eigen::Vector3f::Zero(), age_s, intensity, 0};
}

/// Points identified by their intensity, which is their index.
std::vector<SweepPoint> numbered_points(std::size_t count) {
  std::mt19937 random{1};
  std::uniform_real_distribution<float> coordinate{-20.0F, 20.0F};
  std::vector<SweepPoint> points;
  for (std::size_t i = 0; i < count; ++i)
    points.push_back(point(coordinate(random), coordinate(random), coordinate(random), 0.0F, static_cast<float>(i)));
  return points;
}

std::vector<float> places(const std::vector<SweepPoint>& points) {
  std::vector<float> result;
  for (const SweepPoint& p : points)
    result.push_back(p.intensity);
  return result;
}

TEST(VoxelFilter, PointsOfAVoxelBecomeTheirMean) {
  VoxelFilter filter({.enabled = true, .leaf_m = 1.0}, 10);
  std::vector<SweepPoint> points{point(0.2F, 0.1F, 0.1F, 0.02F, 10), point(5, 5, 5, 0.5F, 7),
                                 point(0.4F, 0.3F, 0.9F, 0.04F, 30)};
  points[0].normal_base = {0, 0, 1};
  points[2].normal_base = {1, 0, 0};
  filter.apply(points);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_LT((points[0].position_base_m - Eigen::Vector3f{0.3F, 0.2F, 0.5F}).norm(), 1e-6F);
  EXPECT_NEAR(points[0].age_s, 0.03F, 1e-6F);
  EXPECT_NEAR(points[0].intensity, 20.0F, 1e-5F);
  EXPECT_LT((points[0].normal_base - Eigen::Vector3f{1, 0, 1}.normalized()).norm(), 1e-6F);
  EXPECT_EQ(points[1].position_base_m, Eigen::Vector3f(5, 5, 5));
}

TEST(VoxelFilter, OrderIsThatOfTheFirstPointOfEachVoxel) {
  VoxelFilter filter({.enabled = true, .leaf_m = 1.0}, 10);
  std::vector<SweepPoint> points{point(9.5F, 0.5F, 0.5F), point(-3.5F, 0.5F, 0.5F), point(4.5F, 0.5F, 0.5F),
                                 point(-3.4F, 0.5F, 0.5F), point(9.6F, 0.5F, 0.5F)};
  filter.apply(points);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_NEAR(points[0].position_base_m.x(), 9.55F, 1e-5F);
  EXPECT_NEAR(points[1].position_base_m.x(), -3.45F, 1e-5F);
  EXPECT_NEAR(points[2].position_base_m.x(), 4.5F, 1e-5F);
}

TEST(VoxelFilter, BothSidesOfZeroAreDifferentVoxels) {
  VoxelFilter filter({.enabled = true, .leaf_m = 1.0}, 2);
  std::vector<SweepPoint> points{point(0.1F, 0.1F, 0.1F), point(-0.1F, 0.1F, 0.1F)};
  filter.apply(points);
  EXPECT_EQ(points.size(), 2U);
}

TEST(VoxelFilter, EmptyInputGivesEmptyOutput) {
  VoxelFilter filter({.enabled = true, .leaf_m = 1.0}, 2);
  std::vector<SweepPoint> points;
  filter.apply(points);
  EXPECT_TRUE(points.empty());
}

TEST(RandomFilter, KeepsExactlyTheShareInOrder) {
  for (const double keep : {0.001, 0.1, 0.333, 0.5, 1.0}) {
    RandomFilter filter({.enabled = true, .keep = keep}, 1);
    std::vector<SweepPoint> points = numbered_points(1000);
    filter.apply(points);
    const std::vector<float> kept = places(points);
    EXPECT_EQ(kept.size(), static_cast<std::size_t>(std::llround(keep * 1000)));
    EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
    EXPECT_EQ(std::adjacent_find(kept.begin(), kept.end()), kept.end());
  }
}

TEST(RandomFilter, TheSameSeedMakesTheSameChoices) {
  const auto choices = [](std::uint64_t seed) {
    RandomFilter filter({.enabled = true, .keep = 0.1}, seed);
    std::vector<std::vector<float>> all;
    for (int sweep = 0; sweep < 3; ++sweep) {
      std::vector<SweepPoint> points = numbered_points(500);
      filter.apply(points);
      all.push_back(places(points));
    }
    return all;
  };
  EXPECT_EQ(choices(7), choices(7));
  EXPECT_NE(choices(7), choices(8));
  EXPECT_NE(choices(7)[0], choices(7)[1]) << "not the same points of every sweep";
}

TEST(RandomFilter, EveryPointIsEquallyLikely) {
  RandomFilter filter({.enabled = true, .keep = 0.2}, 3);
  std::vector<int> times_kept(50);
  constexpr int kSweeps = 5000;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::vector<SweepPoint> points = numbered_points(times_kept.size());
    filter.apply(points);
    for (const float place : places(points))
      ++times_kept[static_cast<std::size_t>(place)];
  }
  for (const int times : times_kept)
    EXPECT_NEAR(times, 0.2 * kSweeps, 5 * std::sqrt(0.2 * 0.8 * kSweeps)); // five sigma
}

} // namespace
} // namespace locus
