// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/scan_normals.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

namespace locus {
namespace {

/// A spherical scan: lines two degrees apart, points one degree apart; `range_m` maps the ray direction to its range.
std::vector<SweepPoint> scan(int lines, const std::function<std::optional<double>(const Eigen::Vector3d&)>& range_m,
                             double noise_m = 0.0) {
  std::mt19937 random{1};
  std::normal_distribution<double> noise{0.0, noise_m};
  std::vector<SweepPoint> points;
  for (int line = 0; line < lines; ++line) {
    const double elevation = (2.0 * line - 15.0) * kRadPerDeg;
    for (int step = 0; step < 360; ++step) {
      const double azimuth = step * kRadPerDeg;
      const Eigen::Vector3d direction{std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * -std::sin(azimuth),
                                      std::sin(elevation)};
      const std::optional<double> range = range_m(direction);
      if (!range || *range > 30.0)
        continue;
      const double measured_m = *range + (noise_m > 0.0 ? noise(random) : 0.0);
      points.push_back({(measured_m * direction).cast<float>(), Eigen::Vector3f::Zero(),
                        0.1F * (1.0F - static_cast<float>(step) / 360.0F), 0.0F, static_cast<std::uint16_t>(line)});
    }
  }
  return points;
}

std::optional<double> floor_below(const Eigen::Vector3d& direction) {
  return direction.z() < -0.01 ? std::optional{-1.0 / direction.z()} : std::nullopt;
}

/// Four walls of a square room of 8 m.
std::optional<double> walls(const Eigen::Vector3d& direction) {
  return 4.0 / direction.head<2>().cwiseAbs().maxCoeff();
}

double angle_deg(const Eigen::Vector3f& a, const Eigen::Vector3d& b) {
  return std::acos(std::min(1.0, std::abs(a.cast<double>().dot(b)))) / kRadPerDeg;
}

/// Inward normal of the wall that a point lies on.
Eigen::Vector3d wall_normal(const SweepPoint& point) {
  const Eigen::Vector3d p = point.position_base_m.cast<double>();
  return std::abs(p.x()) > std::abs(p.y()) ? Eigen::Vector3d{-std::copysign(1.0, p.x()), 0, 0}
                                           : Eigen::Vector3d{0, -std::copysign(1.0, p.y()), 0};
}

std::vector<SweepPoint> with_normals(std::vector<SweepPoint> points) {
  ScanNormals(points.size()).estimate(points);
  return points;
}

std::size_t count_with_normal(const std::vector<SweepPoint>& points) {
  return static_cast<std::size_t>(
      std::count_if(points.begin(), points.end(), [](const SweepPoint& p) { return !p.normal_base.isZero(); }));
}

TEST(ScanNormals, AFloorPointsUp) {
  const auto points = with_normals(scan(8, floor_below));
  EXPECT_GT(count_with_normal(points), points.size() / 10) << "far out, the lines lie too far apart";
  for (const SweepPoint& p : points) {
    if (!p.normal_base.isZero()) {
      EXPECT_LT((p.normal_base - Eigen::Vector3f::UnitZ()).norm(), 1e-3F) << "unit, towards the lidar";
    }
  }
}

TEST(ScanNormals, EdgeNormalBelongsToOnePlaneOrNone) {
  const auto points = with_normals(scan(16, walls));
  EXPECT_GT(count_with_normal(points), points.size() * 9 / 10);
  for (const SweepPoint& p : points) {
    if (p.normal_base.isZero())
      continue;
    EXPECT_NEAR(p.normal_base.norm(), 1.0F, 1e-5F);
    EXPECT_LT(p.normal_base.dot(p.position_base_m), 0.0F);
    const Eigen::Vector2f xy = p.position_base_m.head<2>().cwiseAbs();
    const bool near_corner = xy.minCoeff() > 4.0F - 0.25F;
    const double off_deg = near_corner ? std::min(angle_deg(p.normal_base, Eigen::Vector3d::UnitX()),
                                                  angle_deg(p.normal_base, Eigen::Vector3d::UnitY()))
                                       : angle_deg(p.normal_base, wall_normal(p));
    EXPECT_LT(off_deg, near_corner ? 15.0 : 0.5);
  }
}

TEST(ScanNormals, SingleScanLineHasNoNormals) { EXPECT_EQ(count_with_normal(with_normals(scan(1, walls))), 0U); }

TEST(ScanNormals, OnlyNeighbouringLinesSupportEachOther) {
  std::vector<SweepPoint> points = scan(16, walls);
  std::erase_if(points, [](const SweepPoint& p) { return p.scan_line % 2 == 1; });
  EXPECT_EQ(count_with_normal(with_normals(points)), 0U);
}

TEST(ScanNormals, TwoCentimetresOfNoiseCostAFewDegrees) {
  const auto points = with_normals(scan(16, walls, 0.02));
  std::vector<double> off_deg;
  for (const SweepPoint& p : points)
    if (!p.normal_base.isZero() && p.position_base_m.head<2>().cwiseAbs().minCoeff() < 3.0F)
      off_deg.push_back(angle_deg(p.normal_base, wall_normal(p)));
  ASSERT_GT(off_deg.size(), points.size() / 4);
  std::nth_element(off_deg.begin(), off_deg.begin() + static_cast<std::ptrdiff_t>(off_deg.size() / 2), off_deg.end());
  EXPECT_LT(off_deg[off_deg.size() / 2], 15.0);
}

TEST(ScanNormals, ThicketHasFewNormals) {
  const auto points = with_normals(scan(
      16, [](const Eigen::Vector3d&) { return std::optional{4.0}; }, 0.5));
  EXPECT_LT(count_with_normal(points), points.size() / 5);
}

TEST(ScanNormals, EmptyInputIsAccepted) {
  std::vector<SweepPoint> points;
  ScanNormals(0).estimate(points);
  EXPECT_TRUE(points.empty());
}

} // namespace
} // namespace locus
