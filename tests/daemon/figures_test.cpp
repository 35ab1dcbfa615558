// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <vector>

namespace locus::daemon {
namespace {

using std::chrono::milliseconds;

/// Sweep of a drive along x at one metre per sweep, with this processing time; its rotation is from source 1.
ProcessedSweep sweep(unsigned number, Duration wall) {
  ProcessedSweep done;
  done.estimate.T_odom_base.translation.x() = number;
  done.estimate.twist_base[0] = 10.0;
  done.estimate.prior = {{.rotation = SourceId{1}, .translation = SourceId{number % 2U}}};
  done.raw_returns = 100;
  done.took.wall = wall;
  done.stages_took[0] = milliseconds{2};
  return done;
}

TEST(SweepStatistics, SumsCoverAllSweepsAndDistributionsTheLatest) {
  SweepStatistics statistics(100);
  for (unsigned i = 0; i < 200; ++i)
    statistics.add(sweep(i, milliseconds{i}));
  const SweepFigures figures = statistics.figures();
  EXPECT_EQ(figures.sweeps, 200U);
  EXPECT_EQ(figures.raw_points, 20'000);
  EXPECT_EQ(figures.path_m, 199);
  EXPECT_EQ(figures.largest_speed_mps, 10);
  EXPECT_EQ(figures.used_sweeps[0], 100U);
  EXPECT_EQ(figures.used_sweeps[1], 200U) << "one that gives both counts once";
  EXPECT_EQ(figures.stages[0], milliseconds{400});
  EXPECT_EQ(figures.process_ms.p50, 149) << "of 100 to 199";
  EXPECT_EQ(figures.process_ms.p99, 198);
  EXPECT_EQ(figures.process_ms.max, 199);
  EXPECT_EQ(figures.last->T_odom_base.translation.x(), 199);
  EXPECT_GT(figures.rate_hz, 10);
}

TEST(SweepStatistics, IsEmptyBeforeTheFirstSweep) {
  const SweepFigures figures = SweepStatistics(100).figures();
  EXPECT_FALSE(figures.last);
  EXPECT_EQ(figures.process_ms.max, 0);
  EXPECT_EQ(figures.rate_hz, 0);
}

TEST(SweepStatistics, CountSweepsWithoutASourceAfterTheFirst) {
  SweepStatistics statistics(100);
  for (unsigned i = 0; i < 6; ++i) {
    ProcessedSweep done = sweep(i, milliseconds{1});
    if (i != 3)
      done.estimate.prior.rotation.reset();
    if (i < 3)
      done.estimate.prior.translation.reset();
    if (i == 2)
      done.estimate.state = TrackingState::dead_reckoning;
    done.estimate.sources[1].test_ratio = i == 4 ? 2.5 : 0.5;
    statistics.add(done);
  }
  const SweepFigures figures = statistics.figures();
  EXPECT_EQ(figures.without_source, 2U) << "0, 1 and 2 have none, and 4 and 5 have half";
  EXPECT_EQ(figures.dead_reckoned, 1U);
  EXPECT_EQ(figures.largest_test_ratios[0], 0.0);
  EXPECT_EQ(figures.largest_test_ratios[1], 2.5);
}

/// Digest of a drive whose poses `change` alters.
std::string digest_of(const auto& change) {
  SweepStatistics statistics(100);
  for (unsigned i = 0; i < 10; ++i) {
    ProcessedSweep done = sweep(i, milliseconds{i});
    done.estimate.stamp = stamp_from_ns(1'700'000'000'000'000'000) + i * milliseconds{100};
    change(i, done.estimate);
    statistics.add(done);
  }
  return statistics.figures().trajectory_digest;
}

TEST(SweepStatistics, DigestIsOfThePosesAndTheTimesBetweenThem) {
  const auto unchanged = [](unsigned, OdometryEstimate&) {};
  const std::string digest = digest_of(unchanged);
  EXPECT_EQ(digest.size(), 16U);
  EXPECT_EQ(digest_of(unchanged), digest);
  EXPECT_EQ(digest_of([](unsigned, OdometryEstimate& estimate) { estimate.stamp += std::chrono::hours{1}; }), digest)
      << "played later";
  std::vector<std::string> changed;
  changed.push_back(digest_of([](unsigned i, OdometryEstimate& estimate) {
    double& x = estimate.T_odom_base.translation.x();
    if (i == 5)
      x = std::nextafter(x, 100.0);
  }));
  changed.push_back(digest_of([](unsigned i, OdometryEstimate& estimate) {
    double& w = estimate.T_odom_base.rotation.w();
    if (i == 5)
      w = std::nextafter(w, 0.0);
  }));
  changed.push_back(digest_of([](unsigned i, OdometryEstimate& estimate) {
    if (i == 5)
      estimate.stamp += std::chrono::nanoseconds{1};
  }));
  for (const std::string& other : changed)
    EXPECT_NE(other, digest);
}

TEST(Figures, LineSummarisesTheRun) {
  const Config config = Config{};
  Figures figures{.config = config};
  figures.counters = {.seen = 300, .processed = 295, .dropped = 2, .failed = 3};
  figures.sweeps.trajectory_digest = "0123456789abcdef";
  EXPECT_EQ(summary_line(figures), "300 sweeps: 2 dropped, 3 failed, 0 dead reckoned, 0 without a source; no source "
                                   "compared; trajectory 0123456789abcdef");
  figures.sweeps.dead_reckoned = 4;
  figures.sweeps.without_source = 1;
  figures.sweeps.largest_test_ratios = {0.5, 3.207};
  EXPECT_EQ(summary_line(figures), "300 sweeps: 2 dropped, 3 failed, 4 dead reckoned, 1 without a source; largest test "
                                   "ratio 3.21 (imu); trajectory 0123456789abcdef");
}

TEST(Figures, ServiceHasTheKeysOfARunAndMore) {
  const Config config = Config{};
  Figures figures{.config = config};
  const auto of_a_run = to_json(figures).flatten();
  figures.live = Figures::Live{};
  figures.live->link.sources.resize(config.motion_sources.size());
  const auto live = to_json(figures).flatten();
  for (const auto& [key, value] : of_a_run.items())
    EXPECT_TRUE(live.contains(key)) << key;
  for (const char* key : {"/state", "/sources/wio/health", "/lidars/front/pps", "/dropped/flood_datagrams",
                          "/dds/domain", "/packets/kernel_drops"}) {
    EXPECT_TRUE(live.contains(key)) << key;
    EXPECT_FALSE(of_a_run.contains(key)) << key;
  }
}

/// The problem is cleared once PTP is repaired.
TEST(Figures, CloudDoubtIsAProblemOnlyWhileItLasts) {
  LidarOptions options;
  options.topic = "/points";
  const Stamp now = stamp_from_ns(1'700'000'000'000'000'000);
  IngestReport::Lidar lidar;
  lidar.last_received = now;
  lidar.clouds = IngestReport::Clouds{};
  constexpr auto kTai = static_cast<std::size_t>(CloudDoubt::tai),
                 kEqual = static_cast<std::size_t>(CloudDoubt::equal_times);
  lidar.clouds->doubts.set(kTai);
  lidar.clouds->last_doubted[kTai] = now - milliseconds{100};
  EXPECT_NE(problem_of(options, lidar).find("37 s ahead"), std::string::npos);
  lidar.clouds->last_doubted[kTai] = now - milliseconds{6000};
  EXPECT_EQ(problem_of(options, lidar), "");
  lidar.clouds->doubts.set(kEqual);
  lidar.clouds->last_doubted[kEqual] = now;
  EXPECT_NE(problem_of(options, lidar).find("all have the same time"), std::string::npos);
  EXPECT_EQ(cloud_doubts(options, lidar).size(), 2U) << "of all that was met";
}

TEST(Figures, MetadataIsStaleWhileTheSensorRunsInAnotherMode) {
  LidarOptions options;
  options.metadata = "front.json";
  IngestReport::Lidar lidar;
  lidar.packets.data = 100'000;
  EXPECT_EQ(problem_of(options, lidar), "");
  lidar.packets_of_other_mode = 129;
  const std::string problem = problem_of(options, lidar);
  EXPECT_NE(problem.find("rejected the last 129 packets"), std::string::npos) << problem;
  EXPECT_NE(problem.find("locusctl fetch SENSOR -o front.json"), std::string::npos) << problem;
}

TEST(Figures, TextOfAServiceWithoutInputReportsIt) {
  const Config config = Config{};
  Figures figures{.config = config};
  figures.live = Figures::Live{};
  const std::string text = to_text(figures);
  for (const char* words : {"   waiting   ", "last never", "pose        none yet", "no data", "never heard", "always"})
    EXPECT_NE(text.find(words), std::string::npos) << words << '\n' << text;
}

} // namespace
} // namespace locus::daemon
