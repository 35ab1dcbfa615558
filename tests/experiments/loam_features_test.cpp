// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/loam_features.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace locus::experiments {
namespace {

/// One turn of one laser, a return every 0.2 degrees at `range_at(azimuth_rad)`.
template <class RangeAt> Sweep turn(RangeAt&& range_at, std::uint16_t scan_line = 0) {
  constexpr int kReturns = 1800;
  Sweep sweep;
  for (int i = 0; i < kReturns; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / kReturns, range_m = range_at(azimuth);
    sweep.points.push_back(
        {.position_base_m = Eigen::Vector3d(range_m * std::cos(azimuth), range_m * std::sin(azimuth), 0).cast<float>(),
         .normal_base = Eigen::Vector3f::Zero(),
         .age_s = 0.1F * static_cast<float>(kReturns - i) / kReturns,
         .intensity = 0,
         .scan_line = scan_line});
  }
  sweep.registered = sweep.points.size();
  return sweep;
}

/// Range to the walls of a square room of 10 m, from its centre.
double square_room(double azimuth) { return 5 / std::max(std::abs(std::cos(azimuth)), std::abs(std::sin(azimuth))); }

bool near_corner(const SweepPoint& point, float within_m) {
  return (point.position_base_m.head<2>().cwiseAbs() - Eigen::Vector2f(5, 5)).norm() < within_m;
}

TEST(LoamFeatures, CornersAreEdgesAndWallsArePlanes) {
  Sweep sweep = turn(square_room);
  keep_loam_features(sweep);
  const auto corners = std::ranges::count_if(sweep.points, [](const auto& point) { return near_corner(point, 0.1F); });
  EXPECT_GE(corners, 4) << "each corner is found";
  EXPECT_LE(corners, 12) << "at most a little more than once";
  EXPECT_GT(sweep.points.size(), 100U) << "from walls";
  EXPECT_LE(sweep.points.size(), 4U * (20 + 40)) << "no quarter has more than its share";
  EXPECT_EQ(sweep.registered, sweep.points.size());
}

TEST(LoamFeatures, SelectedPointsAreNotNeighbours) {
  Sweep sweep = turn(square_room);
  keep_loam_features(sweep);
  std::ranges::sort(sweep.points, {}, &SweepPoint::age_s);
  for (std::size_t i = 1; i < sweep.points.size(); ++i)
    EXPECT_GT(sweep.points[i].age_s - sweep.points[i - 1].age_s, 5 * 0.1F / 1800);
}

TEST(LoamFeatures, OcclusionBorderIsNoEdge) {
  // A pillar at 2 m occludes part of a round wall at 8 m.
  const auto range_at = [](double azimuth) { return azimuth > 2 && azimuth < 2.2 ? 2.0 : 8.0; };
  Sweep sweep = turn(range_at);
  keep_loam_features(sweep);
  for (const SweepPoint& point : sweep.points) {
    const float azimuth = std::atan2(point.position_base_m.y(), point.position_base_m.x());
    const bool at_shadow = std::abs(azimuth - 2.0F) < 0.015F || std::abs(azimuth - 2.2F) < 0.015F;
    EXPECT_FALSE(at_shadow && point.position_base_m.norm() > 7) << azimuth;
  }
}

TEST(LoamFeatures, SurfacesAlongTheBeamHaveNone) {
  // Two long parallel walls: beyond 8 degrees, adjacent points on a wall are more than 1/40 of their range apart.
  const auto range_at = [](double azimuth) { return std::min(60.0, 1 / std::max(1e-9, std::abs(std::sin(azimuth)))); };
  Sweep sweep = turn(range_at);
  keep_loam_features(sweep);
  EXPECT_GT(sweep.points.size(), 50U);
  for (const SweepPoint& point : sweep.points) {
    const float range_m = point.position_base_m.norm();
    EXPECT_FALSE(range_m > 7.2F && range_m < 50) << range_m;
  }
}

TEST(LoamFeatures, EachScanLineHasItsOwn) {
  Sweep sweep = turn(square_room, 3);
  const Sweep other = turn(square_room, 260);
  sweep.points.insert(sweep.points.end(), other.points.begin(), other.points.end());
  keep_loam_features(sweep);
  const auto of = [&](int line) { return std::ranges::count(sweep.points, line, &SweepPoint::scan_line); };
  EXPECT_GT(of(3), 100);
  EXPECT_EQ(of(3), of(260));
}

TEST(LoamFeatures, TooFewReturnsHaveNone) {
  Sweep sweep = turn(square_room);
  sweep.points.resize(8);
  keep_loam_features(sweep);
  EXPECT_TRUE(sweep.points.empty());
  keep_loam_features(sweep);
  EXPECT_EQ(sweep.registered, 0U);
}

} // namespace
} // namespace locus::experiments
