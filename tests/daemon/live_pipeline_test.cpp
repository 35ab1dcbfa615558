// SPDX-License-Identifier: Apache-2.0
#include "daemon/live_pipeline.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <ctime>
#include <iterator>
#include <optional>
#include <thread>
#include <vector>

#include "daemon/allocation_counter.hpp"
#include "daemon/drive.hpp"
#include "daemon/input.hpp"
#include "support/held_input.hpp"
#include "support/patience.hpp"

namespace locus::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// Slow motion, so that no registration reaches its deadline.
constexpr double kNoHurry = 1e-3;

/// Returns the inputs of the drive up to a requested sweep.
class MeteredInput : public test::HeldInput {
 public:
  using test::HeldInput::HeldInput;

  /// Lets the ingest hand over this many sweeps in total; returns when it is at rest.
  void hand_over(const LivePipeline& pipeline, std::uint64_t sweeps) {
    wanted_.store(sweeps);
    pipeline_.store(&pipeline);
    const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
    while (resting_at_.load() < sweeps && read_clock(CLOCK_MONOTONIC) < give_up)
      std::this_thread::sleep_for(microseconds{100});
  }

 private:
  bool waits() override {
    const LivePipeline* pipeline = pipeline_.load();
    const std::uint64_t seen = pipeline != nullptr ? pipeline->counters().seen : 0;
    if (seen < wanted_.load())
      return false;
    resting_at_.store(seen); // the next call means that all previous inputs are handed over
    return true;
  }

  std::atomic<std::uint64_t> wanted_{0}, resting_at_{0};
};

/// Returns the inputs patiently until the initial motion is estimated, which takes as long as dozens of sweeps; paced
/// from then on.
class PacedAfterStart : public InputSource {
 public:
  PacedAfterStart(InputSource& drive, double speed) : patient_(drive), paced_(drive, speed) {}

  void wait_for(const LivePipeline* pipeline) {
    patient_.wait_for(pipeline);
    pipeline_.store(pipeline);
  }

  Input next(Duration timeout) override {
    constexpr std::uint64_t kStartsAt = 3;
    const LivePipeline* pipeline = pipeline_.load();
    const bool started = pipeline != nullptr && pipeline->counters().processed >= kStartsAt;
    return started ? paced_.next(timeout) : patient_.next(timeout);
  }

 private:
  test::PatientInput patient_;
  PacedInput paced_; ///< its clock starts with its first input
  std::atomic<const LivePipeline*> pipeline_{nullptr};
};

/// A robot without sensors.
class SilentInput : public InputSource {
 public:
  Input next(Duration timeout) override {
    std::this_thread::sleep_for(timeout);
    return Silence{};
  }
};

/// Returns the next estimate; nothing once the pipeline has finished, or after the test's patience.
std::optional<ProcessedSweep> next_estimate(LivePipeline& pipeline) {
  const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
  while (!pipeline.finished() && read_clock(CLOCK_MONOTONIC) < give_up)
    if (auto done = pipeline.next(milliseconds{100}))
      return done;
  return std::nullopt;
}

std::optional<std::uint64_t> next_sequence(LivePipeline& pipeline) {
  const auto done = next_estimate(pipeline);
  return done ? std::optional{done->sequence} : std::nullopt;
}

std::vector<ProcessedSweep> fetch_all(LivePipeline& pipeline) {
  std::vector<ProcessedSweep> fetched;
  while (const auto done = next_estimate(pipeline))
    fetched.push_back(*done);
  return fetched;
}

void expect_adds_up(const SweepCounters& counters) {
  EXPECT_EQ(counters.seen, counters.processed + counters.dropped + counters.failed);
}

Duration median_wall(std::vector<ProcessedSweep>::const_iterator begin,
                     std::vector<ProcessedSweep>::const_iterator end) {
  std::vector<Duration> walls;
  std::transform(begin, end, std::back_inserter(walls), [](const ProcessedSweep& done) { return done.took.wall; });
  std::nth_element(walls.begin(), walls.begin() + static_cast<std::ptrdiff_t>(walls.size() / 2), walls.end());
  return walls[walls.size() / 2];
}

TEST(LivePipeline, SameBitsAsOneThreadWithoutDrops) {
  const Config config = Drive::config();
  const std::vector<ProcessedSweep> expected = process_in_one_thread(config);
  DriveInput drive;
  test::PatientInput input(drive);
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry});
  input.wait_for(&pipeline);
  const std::vector<ProcessedSweep> fetched = fetch_all(pipeline);
  pipeline.stop();

  ASSERT_EQ(fetched.size(), expected.size());
  for (std::size_t i = 0; i < fetched.size(); ++i) {
    const OdometryEstimate& estimate = fetched[i].estimate;
    EXPECT_EQ(fetched[i].sequence, expected[i].sequence);
    EXPECT_EQ(estimate.stamp, expected[i].estimate.stamp);
    EXPECT_EQ(estimate.T_odom_base, expected[i].estimate.T_odom_base) << "sweep " << i;
    EXPECT_EQ(estimate.pose_covariance, expected[i].estimate.pose_covariance) << "sweep " << i;
  }
  expect_adds_up(pipeline.counters());
  EXPECT_EQ(pipeline.counters().dropped, 0U);
  EXPECT_EQ(pipeline.counters().seen, expected.size());
}

/// Sweeps arrive three times as fast as they can be registered: both registration steps, all returns, no deadline. A
/// queue would increase the age of every estimate; instead the newest sweep is processed and the rest is counted as
/// dropped.
TEST(LivePipeline, OverloadDropsSweepsAndNeverMakesEstimatesOlder) {
  Config config = Drive::config();
  config.sweep.segment_filter.enabled = false;
  config.odometry.scan_to_scan_mode = ScanToScanMode::always;
  config.odometry.threads = 1;
  const std::vector<ProcessedSweep> alone = process_in_one_thread(config);
  const Duration registration = median_wall(alone.begin(), alone.end());
  DriveInput drive;
  PacedAfterStart input(drive, 3.0 * to_seconds(milliseconds{100}) / to_seconds(registration));
  std::vector<std::uint64_t> seen; // sweeps seen when the odometry became idle
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry, .after_estimate = [&](const auto&...) {
                                                               seen.push_back(pipeline.counters().seen);
                                                             }});
  input.wait_for(&pipeline);
  const std::vector<ProcessedSweep> fetched = fetch_all(pipeline);
  pipeline.stop();

  const SweepCounters counters = pipeline.counters();
  expect_adds_up(counters);
  EXPECT_EQ(counters.seen, alone.size());
  EXPECT_GT(counters.dropped, counters.seen / 8);
  EXPECT_EQ(fetched.size(), counters.processed + counters.failed);
  ASSERT_GE(fetched.size(), 9U);
  EXPECT_TRUE(std::is_sorted(fetched.begin(), fetched.end(),
                             [](const ProcessedSweep& a, const ProcessedSweep& b) { return a.sequence < b.sequence; }));
  EXPECT_EQ(fetched.back().sequence, alone.back().sequence) << "the newest sweep always is processed";
  for (std::size_t i = 1; i < fetched.size(); ++i) // the last one seen may not be handed over yet
    EXPECT_GE(fetched[i].sequence + 2, seen[i - 1]) << "older than a period when it was taken";
  const auto third = static_cast<std::ptrdiff_t>(fetched.size() / 3);
  const Duration at_first = median_wall(fetched.begin(), fetched.begin() + third);
  const Duration at_last = median_wall(fetched.end() - third, fetched.end());
  RecordProperty("dropped_of_80", static_cast<int>(counters.dropped));
  RecordProperty("registration_us", static_cast<int>(registration / microseconds{1}));
  RecordProperty("age_us_first_third", static_cast<int>(at_first / microseconds{1}));
  RecordProperty("age_us_last_third", static_cast<int>(at_last / microseconds{1}));
  EXPECT_LT(to_seconds(at_last), 3.0 * to_seconds(at_first));
}

/// Blocks the odometry while sweeps arrive. Afterwards it processes the newest; all others are dropped and counted, and
/// the following ones are processed one by one.
TEST(LivePipeline, NewestSweepIsNextAfterAnOverloadAndNoneIsDroppedThen) {
  const Config config = Drive::config();
  DriveInput drive;
  MeteredInput input(drive);
  constexpr std::uint64_t kNone = ~0ULL;
  std::atomic<std::uint64_t> busy_with{kNone};
  const auto keep_busy = [&](const Sweep& sweep, const auto&...) {
    while (sweep.sequence == busy_with.load())
      std::this_thread::sleep_for(microseconds{100});
  };
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry, .after_estimate = keep_busy});
  std::uint64_t seen = 0, dropped = 0;
  for (const std::uint64_t meanwhile : {1U, 2U, 9U, 30U}) {
    busy_with.store(seen);
    input.hand_over(pipeline, seen += 1);
    ASSERT_EQ(next_sequence(pipeline), seen - 1);
    input.hand_over(pipeline, seen += meanwhile);
    busy_with.store(kNone);
    EXPECT_EQ(next_sequence(pipeline), seen - 1) << "the newest";
    dropped += meanwhile - 1;
    for (int i = 0; i < 3; ++i) {
      input.hand_over(pipeline, seen += 1);
      EXPECT_EQ(next_sequence(pipeline), seen - 1);
    }
    EXPECT_EQ(pipeline.counters().dropped, dropped);
  }
  pipeline.stop();
  expect_adds_up(pipeline.counters());
  EXPECT_EQ(pipeline.counters().seen, seen);
}

/// Inputs wait for this counter until a sweep is processed; its estimate must then be available.
TEST(LivePipeline, ProcessedSweepHasItsEstimateReady) {
  const Config config = Drive::config();
  DriveInput drive;
  test::PatientInput input(drive);
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry});
  input.wait_for(&pipeline);
  const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
  std::uint64_t fetched = 0, missing = 0;
  while (!pipeline.finished() && read_clock(CLOCK_MONOTONIC) < give_up) {
    const SweepCounters counters = pipeline.counters();
    for (; fetched < counters.processed + counters.failed; ++fetched)
      missing += pipeline.next(Duration::zero()) ? 0U : 1U;
  }
  EXPECT_EQ(missing, 0U);
  EXPECT_EQ(fetched, Drive::kSweeps);
}

/// Purpose of the deadline: a registration that is too slow is cut short, and few sweeps are dropped.
TEST(LivePipeline, RegistrationStopsAnIterationAfterItsDeadline) {
  constexpr double kImpossible = 1e9; // every deadline is over before the registration starts
  DriveInput drive;
  test::PatientInput input(drive);
  const Config config = Drive::config();
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kImpossible});
  input.wait_for(&pipeline);
  const std::vector<ProcessedSweep> fetched = fetch_all(pipeline);
  ASSERT_FALSE(fetched.empty());
  for (const ProcessedSweep& done : fetched)
    EXPECT_LE(done.estimate.scan_to_submap.iterations, 1) << "sweep " << done.sequence;
}

TEST(LivePipeline, SlowConsumerLosesEstimatesAndDelaysNoThread) {
  const Config config = Drive::config();
  DriveInput drive;
  test::PatientInput input(drive);
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry});
  input.wait_for(&pipeline);
  const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
  while (pipeline.counters().seen < Drive::kSweeps - 1 && read_clock(CLOCK_MONOTONIC) < give_up)
    std::this_thread::sleep_for(milliseconds{1});
  pipeline.stop();

  const SweepCounters counters = pipeline.counters();
  expect_adds_up(counters);
  EXPECT_EQ(pipeline.unfetched(), counters.processed + counters.failed - LivePipeline::kMaxUnfetched);
  EXPECT_FALSE(pipeline.finished());
  EXPECT_EQ(fetch_all(pipeline).size(), LivePipeline::kMaxUnfetched);
}

TEST(LivePipeline, StopsInSilence) {
  SilentInput input;
  const Config config = Drive::config();
  LivePipeline pipeline(config, open_lidars(config), input);
  const auto begun = pipeline.progress();
  const Duration give_up = read_clock(CLOCK_MONOTONIC) + test::patience();
  while (pipeline.progress().ingest < begun.ingest + 3 && read_clock(CLOCK_MONOTONIC) < give_up)
    std::this_thread::sleep_for(milliseconds{1});
  pipeline.stop();
  EXPECT_TRUE(pipeline.finished());
  EXPECT_EQ(pipeline.counters(), SweepCounters{});
}

TEST(LivePipeline, StopInMidDriveAccountsForEverySweep) {
  constexpr std::uint64_t kSeen = Drive::kSweeps / 2;
  DriveInput drive;
  MeteredInput input(drive);
  const Config config = Drive::config();
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry});
  input.hand_over(pipeline, kSeen);
  EXPECT_TRUE(next_sequence(pipeline));
  pipeline.stop();
  expect_adds_up(pipeline.counters());
  EXPECT_EQ(pipeline.counters().seen, kSeen);
}

/// Covers both threads and the consumer. One registration thread: a worker would start up at an arbitrary time.
TEST(LivePipeline, AllocatesNothingOnceWarm) {
  if (!allocations())
    GTEST_SKIP() << "a sanitizer is in the way of counting";
  constexpr std::uint64_t kWarm = 40;
  Config config = Drive::config();
  config.odometry.threads = 1;
  DriveInput drive;
  test::PatientInput input(drive);
  Drive::instance();
  LivePipeline pipeline(config, open_lidars(config), input, {.speed = kNoHurry});
  input.wait_for(&pipeline);
  std::optional<std::uint64_t> before;
  std::optional<std::uint64_t> after;
  while (const auto done = next_estimate(pipeline))
    (done->sequence <= kWarm ? before : after) = allocations();
  ASSERT_TRUE(before && after);
  EXPECT_EQ(*after - *before, 0U);
}

} // namespace
} // namespace locus::daemon
