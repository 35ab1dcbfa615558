// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/ring_segments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

namespace locus {
namespace {

constexpr float kSweep_s = 0.1F;
constexpr int kReturns = 1800; ///< per scan line

/// Adds a single return of one scan line. Returns its segment.
std::uint32_t add(RingSegments& segments, std::uint16_t scan_line, const Eigen::Vector3f& p, float range_m,
                  float time_s, float intensity) {
  const std::size_t lidar = scan_line / 256, laser = scan_line % 256, lane = laser % FiringGroup::kLasers;
  FiringGroup group{};
  group.first_laser = static_cast<std::uint8_t>(laser - lane);
  group.x_m[lane] = p.x();
  group.y_m[lane] = p.y();
  group.z_m[lane] = p.z();
  group.range_m[lane] = range_m;
  group.offset_ns[lane] = static_cast<std::int32_t>(1e9F * time_s);
  group.ring[lane] = static_cast<std::uint8_t>(laser);
  group.intensity[lane] = static_cast<std::uint8_t>(intensity);
  RingSegments::Mask counts{};
  counts[lane] = -1;
  const std::size_t refused = segments.add(lidar, group, counts);
  const std::uint32_t segment = segments.latest(lidar, laser);
  EXPECT_EQ(refused, segment == RingSegments::kNone ? 1U : 0U);
  return segment;
}

/// Adds one full revolution of a scan line; `range_m` maps azimuth to range. Returns the segment of each return.
std::vector<std::uint32_t> scan(RingSegments& segments, std::uint16_t scan_line,
                                const std::function<double(double)>& range_m) {
  std::vector<std::uint32_t> result;
  for (int i = 0; i < kReturns; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / kReturns;
    const double r = range_m(azimuth);
    const Eigen::Vector3d p{r * std::cos(azimuth), r * std::sin(azimuth), 0.1 * scan_line};
    result.push_back(add(segments, scan_line, p.cast<float>(), static_cast<float>(r),
                         kSweep_s * static_cast<float>(i) / kReturns, 50.0F));
  }
  return result;
}

double tank(double) { return 5.0; }

/// Range to the walls of a square room of 8 m, from its centre.
double square_room(double azimuth) { return 4.0 / std::max(std::abs(std::cos(azimuth)), std::abs(std::sin(azimuth))); }

TEST(RingSegments, CentroidsAreOrderedByScanLineThenTime) {
  RingSegments segments(2, 100);
  for (const int line : {7, 0, 256 + 3, 2})
    scan(segments, static_cast<std::uint16_t>(line), tank);
  std::vector<SweepPoint> points;
  segments.finish(kSweep_s, points);
  ASSERT_GT(points.size(), 40U);
  for (std::size_t i = 1; i < points.size(); ++i) {
    ASSERT_GE(points[i].scan_line, points[i - 1].scan_line);
    if (points[i].scan_line == points[i - 1].scan_line) {
      ASSERT_LT(points[i].age_s, points[i - 1].age_s);
    }
  }
}

TEST(RingSegments, CentroidIsTheMeanOfItsReturns) {
  RingSegments segments(1, 100);
  std::vector<std::uint32_t> used;
  for (int i = 0; i < 4; ++i)
    used.push_back(add(segments, 0, {5.0F, 0.01F * static_cast<float>(i), 0.0F}, 5.0F, 0.01F * static_cast<float>(i),
                       10.0F * static_cast<float>(i)));
  ASSERT_EQ(used[0], used[3]);
  std::vector<SweepPoint> points;
  segments.finish(kSweep_s, points);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(segments.place_of(used[0]), 0U);
  EXPECT_LT((points[0].position_base_m - Eigen::Vector3f{5.0F, 0.015F, 0.0F}).norm(), 1e-5F);
  EXPECT_NEAR(points[0].age_s, 0.1F - 0.015F, 1e-6F);
  EXPECT_NEAR(points[0].intensity, 15.0F, 1e-5F);
  EXPECT_TRUE(points[0].normal_base.isZero());
}

TEST(RingSegments, RangeStepStartsANewSegment) {
  RingSegments segments(1, 100);
  const std::uint32_t wall = add(segments, 0, {5.0F, 0.0F, 0.0F}, 5.0F, 0.0F, 0.0F);
  const std::uint32_t pillar = add(segments, 0, {4.5F, 0.01F, 0.0F}, 4.5F, 0.001F, 0.0F);
  EXPECT_NE(wall, pillar);
}

TEST(RingSegments, NoSegmentIsLongerThanTheLargestLeaf) {
  RingSegments segments(1, 10); // few: the leaf grows up to its limit
  std::vector<SweepPoint> points;
  for (int sweep = 0; sweep < 10; ++sweep) {
    const auto used = scan(segments, 0, tank);
    segments.finish(kSweep_s, points);
    for (int i = 0; i < kReturns; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / kReturns;
      const Eigen::Vector3d p{5 * std::cos(azimuth), 5 * std::sin(azimuth), 0};
      const std::size_t place = segments.place_of(used[static_cast<std::size_t>(i)]);
      ASSERT_LT((points[place].position_base_m.cast<double>() - p).norm(), 0.25);
    }
  }
}

TEST(RingSegments, LeafAdaptsToTheRequestedNumber) {
  RingSegments segments(1, 1000); // 8 lines of 31 m: a leaf of 0.25 m
  std::vector<SweepPoint> points;
  for (int sweep = 0; sweep < 10; ++sweep) {
    for (std::uint16_t line = 0; line < 8; ++line)
      scan(segments, line, tank);
    segments.finish(kSweep_s, points);
  }
  EXPECT_GT(points.size(), 800U);
  EXPECT_LT(points.size(), 1300U);
}

TEST(RingSegments, WantsFiftyPointsOfEachScanLineUnlessTheyAreRequested) {
  std::vector<SweepPoint> points;
  const auto wanted_of = [&](RingSegments segments, std::uint16_t lines) {
    for (std::uint16_t line = 0; line < lines; ++line)
      scan(segments, line, tank);
    segments.finish(kSweep_s, points);
    return segments.points_wanted();
  };
  EXPECT_EQ(wanted_of({1, std::nullopt}, 0), 2000U);
  EXPECT_EQ(wanted_of({1, std::nullopt}, 16), 2000U);
  EXPECT_EQ(wanted_of({1, std::nullopt}, 64), 3200U);
  EXPECT_EQ(wanted_of({1, std::nullopt}, 128), 6400U);
  EXPECT_EQ(wanted_of({1, 1000}, 128), 1000U);
}

TEST(RingSegments, NoCentroidCutsACorner) {
  RingSegments segments(1, 10);
  std::vector<SweepPoint> points;
  bool corner_left_out = false;
  for (int sweep = 0; sweep < 20; ++sweep) {
    for (const std::uint32_t segment : scan(segments, 0, [&](double a) { return square_room(a + 0.013 * sweep); })) {
      ASSERT_NE(segment, RingSegments::kNone);
    }
    const auto used = scan(segments, 1, square_room);
    segments.finish(kSweep_s, points);
    for (const std::uint32_t segment : used)
      corner_left_out |= segments.place_of(segment) == RingSegments::kNone;
    for (const SweepPoint& p : points) {
      if (p.scan_line != 1)
        continue;
      const double off_m = 4.0 - static_cast<double>(p.position_base_m.head<2>().cwiseAbs().maxCoeff());
      ASSERT_LT(off_m, 0.03);
    }
  }
  EXPECT_TRUE(corner_left_out);
}

TEST(RingSegments, ExcessSegmentsAreRejected) {
  RingSegments segments(1, 1000);
  std::size_t refused = 0;
  for (std::size_t i = 0; i < RingSegments::kMaxSegments + 100; ++i) {
    const float range_m = i % 2 == 0 ? 5.0F : 50.0F;
    if (add(segments, 0, {range_m, 0, 0}, range_m, 0.0F, 0.0F) == RingSegments::kNone)
      ++refused;
  }
  EXPECT_EQ(refused, 100U);
  std::vector<SweepPoint> points;
  segments.finish(kSweep_s, points);
  EXPECT_EQ(points.size(), RingSegments::kMaxSegments);
  EXPECT_NE(add(segments, 0, {5, 0, 0}, 5.0F, 0.0F, 0.0F), RingSegments::kNone) << "the next sweep starts afresh";
}

TEST(RingSegments, CentroidIsDeskewedAtItsMeanTime) {
  RingSegments segments(1, 100);
  PacketMotion motion;
  motion.stamp_s = 0.02F;
  motion.t_m = {0.0F, 0.0F, 2.0F};
  motion.t_mps = {0.0F, 0.0F, 10.0F};
  segments.begin_packet(0, motion);
  for (const float time_s : {0.0F, 0.001F})
    add(segments, 0, {5.0F, 0.0F, 0.0F}, 5.0F, time_s, 0.0F); // after the stamp
  std::vector<SweepPoint> points;
  segments.finish(kSweep_s, points);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_LT((points[0].position_base_m - Eigen::Vector3f{5.0F, 0.0F, 2.005F}).norm(), 1e-5F);
  EXPECT_NEAR(points[0].age_s, 0.1F - 0.0205F, 1e-6F);
}

TEST(RingSegments, LaserWithoutReturnsForAPacketStartsANewSegment) {
  RingSegments segments(1, 100);
  const auto hit = [&] { return add(segments, 0, {5.0F, 0.0F, 0.0F}, 5.0F, 0.0F, 0.0F); };
  segments.begin_packet(0, {});
  const std::uint32_t first = hit();
  segments.begin_packet(0, {});
  EXPECT_EQ(hit(), first) << "the next packet goes on";
  segments.begin_packet(0, {});
  segments.begin_packet(0, {});
  EXPECT_NE(hit(), first);
}

TEST(RingSegments, EmptySweepHasNoCentroids) {
  RingSegments segments(1, 1000);
  std::vector<SweepPoint> points(3);
  segments.finish(kSweep_s, points);
  EXPECT_TRUE(points.empty());
}

} // namespace
} // namespace locus
