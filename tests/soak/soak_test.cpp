// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <set>
#include <string>
#include <vector>

#include "closed_course.hpp"
#include "config/config_yaml.hpp"
#include "drivers/lidar_router.hpp"
#include "looped_course.hpp"
#include "piece.hpp"
#include "support/child.hpp"
#include "support/temporary_folder.hpp"
#include "verdict.hpp"

namespace locus::soak {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Passes on inputs up to the next rest.
template <class Take> void drive_lap(LoopedCourse& course, const Take& take) {
  course.begin_lap({});
  while (!course.is_at_rest())
    take(course.next({}));
}

TEST(LoopedCourse, LapsJoinWithoutAGapAcrossTheEndOfTheHour) {
  const test::TemporaryFolder folder;
  const ClosedCourse closed = closed_course(folder / "lap", seconds{18});
  const Config config = *load_config(closed.folder / "config.yaml");
  LidarRouter lidars = *LidarRouter::open(config.lidars);

  constexpr Duration kHourEnds = seconds{2800}; // the first lap begins 13 min 20 s past the hour
  LoopedCourse course(closed, config, static_cast<std::uint64_t>(kHourEnds / closed.lap) - 1);
  std::optional<OdometrySample> wheels;
  std::optional<ImuSample> imu;
  std::set<std::int64_t> hours_seen;
  const auto take = [&](const daemon::Input& input) {
    if (const auto* datagram = std::get_if<Datagram>(&input)) {
      const LidarPacket* packet = lidars.receive(*datagram);
      ASSERT_TRUE(packet != nullptr || datagram->payload.size() == velodyne::kPositionPacketBytes);
      hours_seen.insert(datagram->receive_stamp.time_since_epoch() / hours{1});
    } else if (const auto* odometry = std::get_if<daemon::OdometryInput>(&input)) {
      if (wheels) {
        ASSERT_LE(odometry->sample.stamp - wheels->stamp, milliseconds{20});
        ASSERT_GT(odometry->sample.stamp, wheels->stamp);
        ASSERT_LT((wheels->T_source_base.inverse() * odometry->sample.T_source_base).translation.norm(), 0.05);
      }
      wheels = odometry->sample;
    } else if (const auto* inertial = std::get_if<daemon::ImuInput>(&input)) {
      if (imu) {
        ASSERT_LE(inertial->sample.stamp - imu->stamp, milliseconds{5});
        ASSERT_GT(inertial->sample.stamp, imu->stamp);
      }
      imu = inertial->sample;
    }
  };
  for (int lap = 0; lap < 3; ++lap)
    drive_lap(course, take);

  EXPECT_EQ(hours_seen.size(), 2U);
  const PacketCounters counters = lidars.total();
  EXPECT_EQ(counters.received, course.given().datagrams);
  EXPECT_EQ(counters.received, counters.data + counters.position);
  EXPECT_EQ(counters.lost, 0U);
  EXPECT_EQ(counters.clock_steps, 0U);
}

/// Six laps in two processes, with restarts on the last three; the first process runs part of the day only.
TEST(SoakProgram, ResumesAfterInterruptionAndAllBoundsHold) {
  const test::TemporaryFolder folder;
  const auto soak_for = [&](double hours_long) {
    return std::vector<std::string>{
        SOAK, "--hours", std::to_string(hours_long), "--piece-minutes", "0.5", folder.path().string()};
  };
  const auto driven = [&] { return read_pieces(folder / "pieces.jsonl"); };
  test::Child interrupted(soak_for(24.0));
  ASSERT_TRUE(interrupted.wait_for_line("hour"));
  interrupted.signal(SIGINT);
  ASSERT_EQ(interrupted.wait_for_exit(), 0);
  const std::size_t before = driven().size();
  ASSERT_GE(before, 1U);

  const std::size_t laps = std::max<std::size_t>(2 * before, 6);
  test::Child resumed(soak_for((static_cast<double>(laps) - 0.5) * driven().front().lap_s / 3600.0));
  ASSERT_TRUE(resumed.wait_until([&](const auto& /*lines*/) { return driven().size() >= laps; }));
  ASSERT_EQ(resumed.wait_for_exit(), 0) << testing::PrintToString(resumed.lines());
  EXPECT_TRUE(resumed.has_line("All bounds hold"));
  const std::vector<Piece> pieces = driven();
  ASSERT_EQ(pieces.size(), laps);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    EXPECT_NEAR(pieces[i].hour, static_cast<double>(i + 1) * pieces[i].lap_s / 3600.0, 1e-6);
    EXPECT_EQ(pieces[i].process_ns == pieces.front().process_ns, i < before);
    EXPECT_EQ(pieces[i].restarts, i < laps / 2 ? 0 : 1);
    EXPECT_EQ(pieces[i].resumed, pieces[i].restarts);
  }
}

/// Six valid pieces per hour, of one process.
std::vector<Piece> good_day(int day_h) {
  std::vector<Piece> pieces;
  for (int i = 1; i <= 6 * day_h; ++i) {
    Piece& piece = pieces.emplace_back();
    piece.process_ns = 1;
    piece.hour = i / 6.0;
    piece.lap_s = 600.0;
    piece.rss_anon_mb = 100.0;
    piece.descriptors = 6;
    piece.cpu_p50_ms = piece.latency_p50_ms = 0.3;
    Counts& c = piece.counts;
    c.seen = c.processed = c.fetched = 6000U * static_cast<std::uint64_t>(i);
    c.datagrams_given = c.datagrams_received = 10 * c.seen;
    c.data = 8 * c.seen;
    c.position = 2 * c.seen;
  }
  return pieces;
}

TEST(Verdict, GoodDayPasses) {
  const Verdict verdict = judge(good_day(24));
  EXPECT_TRUE(verdict.broken.empty());
  EXPECT_NEAR(verdict.growth_mb_per_hour.value(), 0.0, 1e-9);
  EXPECT_NEAR(verdict.cpu_drift.value(), 1.0, 1e-9);
}

TEST(Verdict, LongTermBoundsAreNotJudgedEarly) {
  const Verdict verdict = judge(good_day(1));
  EXPECT_FALSE(verdict.growth_mb_per_hour || verdict.cpu_drift || verdict.latency_drift);
  EXPECT_TRUE(verdict.broken.empty());
  EXPECT_TRUE(judge({}).broken.empty());
}

TEST(Verdict, LeakIsDetectedAtAnyMemoryLevel) {
  std::vector<Piece> pieces = good_day(24);
  for (Piece& piece : pieces) {
    if (piece.hour > 12.0)
      piece.rss_anon_mb += 40.0;
    piece.restarts = piece.resumed = piece.hour > 12.0 ? 1 : 0;
  }
  EXPECT_NEAR(judge(pieces).growth_mb_per_hour.value(), 0.0, 1e-9);
  EXPECT_TRUE(judge(pieces).broken.empty());
  for (Piece& piece : pieces)
    piece.rss_anon_mb += 1.5 * piece.hour;
  EXPECT_NEAR(judge(pieces).growth_mb_per_hour.value(), 1.5, 1e-9);
  EXPECT_EQ(judge(pieces).broken.size(), 1U);
}

TEST(Verdict, EachBoundIsChecked) {
  const auto broken_by = [](const auto& spoil) {
    std::vector<Piece> pieces = good_day(24);
    spoil(pieces);
    return judge(pieces).broken.size();
  };
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].counts.datagrams_given += 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].counts.data -= 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].counts.samples_given += 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].counts.seen += 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].counts.fetched -= 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].descriptors += 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].restarts = 1; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces[70].ape_mean_mm = 60.0; }), 1U);
  EXPECT_EQ(broken_by([](auto& pieces) { pieces.back().lap_s = 660.0; }), 1U); // sixty seconds without a sweep
  const auto slow = [](double Piece::*figure) {
    return [figure](auto& pieces) {
      for (Piece& piece : pieces)
        piece.*figure *= piece.hour > 20.0 ? 1.3 : 1.0;
    };
  };
  EXPECT_EQ(broken_by(slow(&Piece::cpu_p50_ms)), 1U);
  EXPECT_EQ(broken_by(slow(&Piece::latency_p50_ms)), 1U);
}

} // namespace
} // namespace locus::soak
