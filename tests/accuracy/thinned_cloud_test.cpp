// SPDX-License-Identifier: Apache-2.0
#include "accuracy/thinned_cloud.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

TEST(ThinnedCloud, PointsOfAVoxelBecomeTheirMean) {
  ThinnedCloud cloud(1, 10);
  cloud.insert({0.1F, 0.2F, -0.5F});
  cloud.insert({0.3F, 0.4F, -0.7F});
  cloud.insert({1.5F, 0.5F, 0.5F});
  std::vector<Eigen::Vector3f> centroids = cloud.centroids();
  ASSERT_EQ(centroids.size(), 2U);
  if (centroids[0].x() > centroids[1].x())
    std::swap(centroids[0], centroids[1]);
  EXPECT_LT((centroids[0] - Eigen::Vector3f(0.2F, 0.3F, -0.6F)).norm(), 1e-6F);
  EXPECT_EQ(centroids[1], Eigen::Vector3f(1.5F, 0.5F, 0.5F));
}

TEST(ThinnedCloud, BecomesCoarserInsteadOfLarger) {
  ThinnedCloud cloud(0.05F, 100);
  for (int x = 0; x < 200; ++x) {
    for (int y = 0; y < 200; ++y)
      cloud.insert({0.02F * static_cast<float>(x) - 2, 0.02F * static_cast<float>(y) - 2, 3});
  }
  const std::vector<Eigen::Vector3f> centroids = cloud.centroids();
  EXPECT_LE(centroids.size(), 100U);
  EXPECT_GE(centroids.size(), 25U) << "a quarter is left at least when voxels of a plane double";
  for (const Eigen::Vector3f& centroid : centroids)
    EXPECT_NEAR(centroid.z(), 3, 1e-6) << "a plane stays one";
}

} // namespace
} // namespace locus
