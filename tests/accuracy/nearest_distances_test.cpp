// SPDX-License-Identifier: Apache-2.0
#include "accuracy/nearest_distances.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace locus {
namespace {

std::vector<Eigen::Vector3f> random_points(std::size_t count, unsigned seed) {
  std::mt19937 random{seed};
  std::uniform_real_distribution<float> coordinate{-2, 2};
  std::vector<Eigen::Vector3f> points(count);
  for (Eigen::Vector3f& point : points)
    point = {coordinate(random), coordinate(random), coordinate(random)};
  return points;
}

TEST(NearestDistances, AgreeWithBruteForce) {
  const auto few = random_points(200, 1), many = random_points(5000, 2);
  for (const float reach_m : {0.1F, 0.25F, 1.0F}) {
    NearestDistances nearest(few, reach_m);
    for (const Eigen::Vector3f& candidate : many)
      nearest.offer(candidate);
    const std::vector<float> distances_m = nearest.distances_m();
    for (std::size_t i = 0; i < few.size(); ++i) {
      float expected_m = std::numeric_limits<float>::infinity();
      for (const Eigen::Vector3f& candidate : many)
        expected_m = std::min(expected_m, (few[i] - candidate).norm());
      EXPECT_EQ(distances_m[i], expected_m < reach_m ? expected_m : std::numeric_limits<float>::infinity());
    }
  }
}

TEST(NearestDistances, BeyondTheLimitAreInfinite) {
  const std::vector<Eigen::Vector3f> few{{0, 0, 0}, {10, 0, 0}};
  NearestDistances nearest(few, 1);
  EXPECT_TRUE(std::isinf(nearest.distances_m()[0]));
  nearest.offer({0.5F, 0, 0});
  EXPECT_EQ(nearest.distances_m()[0], 0.5F);
  EXPECT_TRUE(std::isinf(nearest.distances_m()[1]));
}

} // namespace
} // namespace locus
