// SPDX-License-Identifier: Apache-2.0
// Points of the sweeps: which are in them, and where.
#include "core/ingest/sweep_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>
#include <vector>

#include "core/ingest/numbered_lidar.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(SweepBuilder, ReturnsOutsideTheRangeAreDropped) {
  SweepOptions options = keep_all();
  options.min_range_m = 1.0;
  options.max_range_m = 50.0;
  for (const auto& [range_m, kept] : {std::pair{0.99F, false}, {1.0F, true}, {50.0F, true}, {50.1F, false}}) {
    NumberedLidar lidar;
    lidar.set_range_m(range_m);
    Built built(options);
    built.play(lidar, milliseconds{250});
    ASSERT_FALSE(built.sweeps.empty());
    EXPECT_EQ(!built.sweeps.front().points.empty(), kept) << range_m;
    EXPECT_GT(built.sweeps.front().raw_returns, 0U);
  }
}

TEST(SweepBuilder, ReturnsFromTheRobotItselfAreDropped) {
  SweepOptions options = keep_all();
  options.body_box = {.enabled = true, .min_m = {999.5, -1, -1}, .max_m = {2000.5, 1, 1}};
  NumberedLidar lidar;
  Built built(options);
  built.play(lidar, milliseconds{250});
  ASSERT_GE(built.sweeps.size(), 2U);
  std::size_t seen = 0;
  for (const SweepPoint& point : built.sweeps.front().points) {
    EXPECT_FALSE(number_of(point) >= 1000 && number_of(point) <= 2000);
    ++seen;
  }
  EXPECT_EQ(seen, built.sweeps.front().raw_returns - 1001);
}

TEST(SweepBuilder, PointsBeyondTheMemoryAreCounted) {
  NumberedLidar lidar;
  Built built(keep_all(), 1, {}, 10'000);
  built.play(lidar, milliseconds{150});
  ASSERT_FALSE(built.sweeps.empty());
  EXPECT_EQ(built.sweeps.front().points.size(), 10'000U);
  EXPECT_GE(built.builder.counters().overflowed_points, built.sweeps.front().raw_returns - 10'000);
}

/// Returns the numbers of the registered points of the first sweep, in which every return is a segment of its own.
std::set<std::size_t> registered_numbers(const BodyBoxOptions& dropped) {
  SweepOptions options;
  options.segment_filter.points = 500;
  options.max_range_m = 1e6;
  options.body_box = dropped;
  NumberedLidar lidar;
  Built built(options);
  built.play(lidar, milliseconds{150});
  std::set<std::size_t> numbers;
  for (std::size_t i = 0; i < built.sweeps.front().registered; ++i)
    numbers.insert(number_of(built.sweeps.front().points[i]));
  return numbers;
}

TEST(SweepBuilder, OnePointLessHardlyChangesTheRegisteredPointsOfOtherScanLines) {
  constexpr std::size_t kDropped = 163;
  const std::set<std::size_t> all = registered_numbers({});
  const std::set<std::size_t> others =
      registered_numbers({.enabled = true, .min_m = {kDropped - 0.5, -1, -1}, .max_m = {kDropped + 0.5, 1, 1}});
  EXPECT_NEAR(static_cast<double>(all.size()), 500, 10);
  std::vector<std::size_t> replaced;
  std::ranges::set_difference(all, others, std::back_inserter(replaced));
  EXPECT_FALSE(replaced.empty()) << "dropped " << kDropped;
  const auto on_other_lines = std::ranges::count_if(
      replaced, [](std::size_t number) { return number % FiringGroup::kLasers != kDropped % FiringGroup::kLasers; });
  EXPECT_LE(on_other_lines, 25) << "a twentieth of them";
}

TEST(SweepBuilder, SinkMayMoveThePointsOut) {
  NumberedLidar lidar;
  std::vector<SweepPoint> mine;
  std::size_t sweeps = 0;
  SweepBuilder builder(keep_all(), {Pose{}}, MotionSources({}, Fusion::combined), Built::kMaxReturns,
                       [&](Sweep& sweep) {
                         std::swap(mine, sweep.points);
                         ++sweeps;
                         if (sweeps > 2) {
                           EXPECT_NEAR(static_cast<double>(mine.size()), 28'930, 400);
                         }
                       });
  while (lidar.next() < kStart + seconds{1}) {
    const LidarPacket packet = lidar.packet();
    builder.add(packet, packet.stamp);
  }
  EXPECT_GE(sweeps, 9U);
}

/// Wheels that report 10 m/s to the left, along y, where all numbered returns are at zero.
class SweepsOfAMovingRobot : public testing::Test {
 protected:
  static constexpr double kSpeed_mps = 10.0;

  static std::vector<Sweep> sweeps(SweepOptions options, bool with_wheels) {
    std::vector<MotionSourceOptions> sources;
    if (with_wheels)
      sources.push_back({"wheels", SourceKind::odometry, {}});
    NumberedLidar lidar;
    Built built(options, 1, sources);
    Stamp next_sample = kStart - milliseconds{100};
    while (lidar.next() < kStart + seconds{1}) {
      for (; with_wheels && next_sample <= lidar.next() + kPacket; next_sample += milliseconds{5})
        built.builder.sources().add(SourceId{0}, OdometrySample{next_sample,
                                                                next_sample,
                                                                {Eigen::Quaterniond::Identity(),
                                                                 {0, kSpeed_mps * to_seconds(next_sample - kStart), 0}},
                                                                1.0});
      built.add(lidar.packet());
    }
    return built.sweeps;
  }
};

TEST_F(SweepsOfAMovingRobot, PointsAreInTheFrameAtTheEndOfTheSweep) {
  const std::vector<Sweep> corrected = sweeps(keep_all(), true);
  ASSERT_GE(corrected.size(), 9U);
  for (const Sweep& sweep : corrected) {
    EXPECT_EQ(sweep.uncorrected, Uncorrected::nothing);
    EXPECT_TRUE(sweep.motion.sources[0].usable);
    for (const SweepPoint& point : sweep.points)
      ASSERT_NEAR(point.position_base_m.y(), -kSpeed_mps * static_cast<double>(point.age_s), 1e-3);
  }
}

TEST_F(SweepsOfAMovingRobot, WithoutDeskewPointsAreAsMeasured) {
  SweepOptions options = keep_all();
  options.motion_correction = false;
  for (const Sweep& sweep : sweeps(options, true)) {
    EXPECT_EQ(sweep.uncorrected, Uncorrected::nothing) << "nor does anybody else correct them";
    EXPECT_TRUE(sweep.motion.sources[0].usable) << "the wheels still tell how far";
    for (const SweepPoint& point : sweep.points)
      ASSERT_EQ(point.position_base_m.y(), 0.0F);
  }
}

TEST_F(SweepsOfAMovingRobot, WithoutASourceDeskewIsLeftToOdometry) {
  for (const Sweep& sweep : sweeps(keep_all(), false)) {
    EXPECT_EQ(sweep.uncorrected, Uncorrected::all);
    for (const SweepPoint& point : sweep.points)
      ASSERT_EQ(point.position_base_m.y(), 0.0F);
  }
}

} // namespace
} // namespace locus::test
