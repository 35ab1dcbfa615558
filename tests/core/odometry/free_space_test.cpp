// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/free_space.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <vector>

namespace locus {
namespace {

using Points = std::vector<Eigen::Vector3f>;

const Eigen::Vector3f kLidar_base_m{0.2F, 0.0F, 0.6F};
const Eigen::Vector3f kSecondLidar_base_m{-1.0F, 0.0F, 0.6F};
constexpr Duration kEveryKeyframe = std::chrono::seconds{1};

Stamp end_of_keyframe(int keyframe) { return stamp_from_ns(1'000'000'000) + keyframe * kEveryKeyframe; }
Pose metres_ahead(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0, 0}}; }

/// Points of a cylindrical wall around the origin of the odom frame, 0.25 m apart in height and one degree in azimuth.
Points wall(float radius_m) {
  Points points;
  for (int degree = 0; degree < 360; ++degree)
    for (float z_m = -1.0F; z_m <= 3.0F; z_m += 0.25F) {
      const float angle = static_cast<float>(degree) * std::numbers::pi_v<float> / 180.0F;
      points.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    }
  return points;
}

/// The side of a vehicle across the x axis.
Points vehicle(float x_m) {
  Points points;
  for (float y_m = -1.0F; y_m <= 1.0F; y_m += 0.1F)
    for (float z_m = 0.0F; z_m <= 1.5F; z_m += 0.1F)
      points.emplace_back(x_m, y_m, z_m);
  return points;
}

Points both(Points one, const Points& other) {
  one.insert(one.end(), other.begin(), other.end());
  return one;
}

/// Removes the points that `hiding` occludes from the lidar.
Points seen_behind(const Points& points, const Points& hiding, const Eigen::Vector3f& lidar_m) {
  const auto is_hidden = [&](const Eigen::Vector3f& point) {
    return std::ranges::any_of(hiding, [&](const Eigen::Vector3f& near) {
      return (point - lidar_m).normalized().dot((near - lidar_m).normalized()) > std::cos(0.03F);
    });
  };
  Points seen;
  std::ranges::copy_if(points, std::back_inserter(seen), [&](const auto& point) { return !is_hidden(point); });
  return both(seen, hiding);
}

struct Seen {
  Points points_odom;
  std::size_t lidar = 0;
};

class FreeSpaceTest : public ::testing::Test {
 protected:
  /// Returns the points that are left of a keyframe, in the odom frame.
  Points take_of(std::size_t lidars, int keyframe, const Pose& T_odom_base, const std::vector<Seen>& seen) {
    Sweep sweep;
    sweep.end = end_of_keyframe(keyframe);
    sweep.lidars.count = lidars;
    sweep.lidars.base_m[0] = kLidar_base_m;
    sweep.lidars.base_m[1] = kSecondLidar_base_m;
    std::vector<SurfacePoint> scan_base;
    for (const Seen& of_one : seen)
      for (const Eigen::Vector3f& point : of_one.points_odom) {
        const Eigen::Vector3f point_base = (T_odom_base.inverse() * point.cast<double>()).cast<float>();
        sweep.points.push_back({.position_base_m = point_base,
                                .normal_base = Eigen::Vector3f::Zero(),
                                .age_s = 0.0F,
                                .intensity = 0.0F,
                                .scan_line = static_cast<std::uint16_t>(of_one.lidar * 256)});
        scan_base.push_back({point_base, Eigen::Vector3f::Zero()});
      }
    space_.expect(sweep);
    Points left;
    for (const SurfacePoint& point : space_.leave_out_contradicting(scan_base, T_odom_base, map_))
      left.push_back((T_odom_base * point.position_m.cast<double>()).cast<float>());
    return left;
  }
  Points take(int keyframe, const Pose& T_odom_base, const Points& points) {
    return take_of(1, keyframe, T_odom_base, {{points}});
  }
  Points around_vehicle(float x_m, const Pose& T_odom_base) const {
    return seen_behind(room_, vehicle(x_m), (T_odom_base * kLidar_base_m.cast<double>()).cast<float>());
  }

  /// Inserts points (odom frame) into the map.
  void map(const Points& points_odom) {
    std::vector<SurfacePoint> points;
    for (const Eigen::Vector3f& point : points_odom)
      points.push_back({point, Eigen::Vector3f::Zero()});
    map_.insert(points, {});
  }

  const Points room_ = wall(10.0F);
  SurfaceMap map_{20'000'000};
  FreeSpace space_;
};

TEST_F(FreeSpaceTest, IsEmptyBeforeTheFirstKeyframe) {
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take(0, {}, seen).size(), seen.size());
  EXPECT_TRUE(take(1, {}, Points{}).empty());
}

TEST_F(FreeSpaceTest, NewObjectsAreRemovedAndStaticOnesRemain) {
  take(0, {}, room_);
  const Points seen = around_vehicle(4.0F, metres_ahead(1.0));
  const Points left = take(1, metres_ahead(1.0), seen);
  EXPECT_EQ(left.size(), seen.size() - vehicle(4.0F).size());
  EXPECT_TRUE(std::ranges::none_of(left, [](const auto& point) { return point.norm() < 9.0F; }));
}

TEST_F(FreeSpaceTest, MovingObjectIsRemovedInEachKeyframe) {
  for (int i = 0; i < 8; ++i)
    take(i, {}, room_);
  for (int i = 8; i < 12; ++i) {
    const float x_m = 8.0F - static_cast<float>(i - 8);
    EXPECT_EQ(take(i, {}, around_vehicle(x_m, {})).size(), around_vehicle(x_m, {}).size() - vehicle(x_m).size()) << i;
  }
}

TEST_F(FreeSpaceTest, ObjectThatStaysIsInsertedFiveKeyframesLater) {
  take(0, {}, room_);
  const Points seen = around_vehicle(4.0F, {});
  for (int i = 1; i <= 5; ++i)
    EXPECT_EQ(take(i, {}, seen).size(), seen.size() - vehicle(4.0F).size()) << i;
  EXPECT_EQ(take(6, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, SurfaceBehindTheLastReturnsIsInsertedOneKeyframeLater) {
  take(0, {}, room_);
  const Points seen = wall(12.0F);
  EXPECT_TRUE(take(1, {}, seen).empty());
  EXPECT_EQ(take(2, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, DisoccludedSurfaceOfTheMapRemains) {
  map(both(room_, vehicle(7.0F)));
  take(0, {}, around_vehicle(4.0F, {}));
  const Points farther = both(room_, vehicle(7.0F)); // the vehicle's position before it was at 4 m
  EXPECT_EQ(take(1, {}, farther).size(), farther.size());
}

TEST_F(FreeSpaceTest, SurfaceSeenBehindAPorousOneRemains) {
  Points grass;
  const Points near = wall(4.0F);
  for (std::size_t i = 0; i < near.size(); i += 2)
    grass.push_back(near[i]);
  take(0, {}, both(grass, room_));
  EXPECT_EQ(take(1, {}, room_).size(), room_.size());
}

TEST_F(FreeSpaceTest, SurfaceThatAnotherLidarSawRemains) {
  take_of(2, 0, {}, {{around_vehicle(4.0F, {}), 0}, {room_, 1}});
  EXPECT_EQ(take_of(2, 1, {}, {{room_, 0}, {{}, 1}}).size(), room_.size());
}

TEST_F(FreeSpaceTest, TenSecondOldSurfaceHidesNothing) {
  take(0, {}, room_);
  const Points seen = wall(12.0F);
  EXPECT_EQ(take(10, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, UnobservedSpaceIsNotFree) {
  Points half;
  std::ranges::copy_if(room_, std::back_inserter(half), [](const auto& point) { return point.x() < 0.0F; });
  take(0, {}, half);
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take(1, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, ObliqueNearbyWallRemains) {
  take(0, {}, room_);
  for (int i = 1; i < 8; ++i)
    EXPECT_EQ(take(i, metres_ahead(i), room_).size(), room_.size()) << i;
}

TEST_F(FreeSpaceTest, FloorBetweenRingsRemains) {
  const auto ring = [](float radius_m) {
    Points points;
    for (int degree = 0; degree < 360; ++degree) {
      const float angle = static_cast<float>(degree) * std::numbers::pi_v<float> / 180.0F;
      points.emplace_back(kLidar_base_m.x() + radius_m * std::cos(angle), radius_m * std::sin(angle), 0.0F);
    }
    return points;
  };
  take(0, {}, both(ring(5.0F), ring(8.8F)));
  EXPECT_EQ(take(1, {}, ring(6.2F)).size(), ring(6.2F).size());
}

TEST_F(FreeSpaceTest, TenSecondOldKeyframeIsIgnored) {
  take(0, {}, room_);
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take(10, {}, seen).size(), seen.size());
  take(11, {}, room_);
  EXPECT_EQ(take(20, {}, seen).size(), seen.size() - vehicle(4.0F).size()) << "nine seconds";
}

TEST_F(FreeSpaceTest, BackwardClockStepExpiresAllKeyframes) {
  take(20, {}, room_);
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take(0, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, ClearDropsAllKeyframes) {
  take(0, {}, room_);
  space_.clear();
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take(1, {}, seen).size(), seen.size());
}

TEST_F(FreeSpaceTest, EachLidarHasItsOwnFreeSpace) {
  take_of(2, 0, {}, {{{}, 0}, {room_, 1}});
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take_of(2, 1, {}, {{seen, 0}, {{}, 1}}).size(), seen.size() - vehicle(4.0F).size());
}

TEST_F(FreeSpaceTest, PointsOfAnUnknownLidarRemain) {
  take_of(0, 0, {}, {{room_, 5}});
  const Points seen = around_vehicle(4.0F, {});
  EXPECT_EQ(take_of(0, 1, {}, {{seen, 5}}).size(), seen.size());
  EXPECT_EQ(take_of(1, 2, {}, {{seen, 5}}).size(), seen.size());
}

} // namespace
} // namespace locus
