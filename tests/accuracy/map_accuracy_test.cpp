// SPDX-License-Identifier: Apache-2.0
#include "accuracy/map_accuracy.hpp"

#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "support/temporary_file.hpp"

namespace locus {
namespace {

using Points = std::vector<Eigen::Vector3f>;

constexpr float kStep_m = 0.05F;

/// Points on the walls of a room around the origin, 4 x 3 x 2 m inside, on a grid; displaced by `inwards_m`.
Points room(float inwards_m) {
  const Eigen::Vector3f half(2, 1.5F, 1);
  Points points;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const int along_u = static_cast<int>(half[u] / kStep_m), along_v = static_cast<int>(half[v] / kStep_m);
    for (int i = -along_u + 2; i <= along_u - 2; ++i) {
      for (int j = -along_v + 2; j <= along_v - 2; ++j) {
        for (const float side : {-1.0F, 1.0F}) {
          Eigen::Vector3f point;
          point[axis] = side * (half[axis] - inwards_m);
          point[u] = kStep_m * static_cast<float>(i);
          point[v] = kStep_m * static_cast<float>(j);
          points.push_back(point);
        }
      }
    }
  }
  return points;
}

Points moved(Points points, const Pose& T) {
  for (Eigen::Vector3f& point : points)
    point = (T * Eigen::Vector3d{point.cast<double>()}).cast<float>();
  return points;
}

class MapAccuracyOf : public testing::Test {
 protected:
  MapAccuracy compared(const Points& map, const Points& truth, const Pose& T_truth_odom = {}) {
    const std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(truth.size()) +
                               "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    std::vector<std::byte> content = test::bytes_of(header);
    const auto data = std::as_bytes(std::span{truth});
    content.insert(content.end(), data.begin(), data.end());
    file_.write(content);
    const auto cloud = PointCloudFile::open(file_.path());
    EXPECT_TRUE(cloud);
    const auto accuracy = map_accuracy(map, *cloud, T_truth_odom);
    EXPECT_TRUE(accuracy);
    return *accuracy;
  }

  test::TemporaryFile file_{"gt_map.ply"};
};

TEST_F(MapAccuracyOf, TheTruthItselfIsZero) {
  const Points truth = room(0);
  const MapAccuracy accuracy = compared(truth, truth);
  EXPECT_NEAR(accuracy.rmse_m.value(), 0, 1e-4);
  EXPECT_EQ(accuracy.compared, truth.size());
  EXPECT_EQ(accuracy.outliers, 0U);
}

TEST_F(MapAccuracyOf, WallOffsetIsTheError) {
  const MapAccuracy accuracy = compared(room(0.04F), room(0));
  EXPECT_NEAR(accuracy.rmse_m.value(), 0.04, 1e-4);
}

TEST_F(MapAccuracyOf, MisplacedMapIsAlignedFirst) {
  const Pose T_wrong{from_rpy_rad({0.01, -0.01, 0.02}), {0.1, -0.08, 0.05}};
  const MapAccuracy accuracy = compared(moved(room(0.04F), T_wrong), room(0));
  EXPECT_NEAR(accuracy.rmse_m.value(), 0.04, 2e-3) << "12 cm and more without the fit";
}

TEST_F(MapAccuracyOf, DistantFramesAreAlignedByTheGivenPose) {
  const Pose T_truth_odom{from_rpy_rad({0.1, 0.2, 2.5}), {40, -30, 5}};
  const MapAccuracy accuracy = compared(room(0.04F), moved(room(0), T_truth_odom), T_truth_odom);
  EXPECT_NEAR(accuracy.rmse_m.value(), 0.04, 1e-3);
}

TEST_F(MapAccuracyOf, PointsBeyondAMetreAreOutliers) {
  Points map = room(0);
  map.emplace_back(2.9F, 0.0F, 0.0F);
  map.emplace_back(3.1F, 0.0F, 0.0F);
  map.emplace_back(300.0F, 0.0F, 0.0F);
  const MapAccuracy accuracy = compared(map, room(0));
  EXPECT_EQ(accuracy.outliers, 2U);
  EXPECT_EQ(accuracy.compared, map.size() - 2);
  EXPECT_NEAR(accuracy.rmse_m.value(), 0.9 / std::sqrt(static_cast<double>(accuracy.compared)), 1e-3);
}

TEST_F(MapAccuracyOf, MapWithoutOverlapHasNoError) {
  const MapAccuracy far = compared({{100, 0, 0}, {101, 0, 0}, {100, 1, 0}, {100, 0, 1}}, room(0));
  EXPECT_FALSE(far.rmse_m);
  EXPECT_EQ(far.outliers, 4U);
  const MapAccuracy none = compared({}, room(0));
  EXPECT_FALSE(none.rmse_m);
  EXPECT_EQ(none.outliers + none.compared, 0U);
}

} // namespace
} // namespace locus
