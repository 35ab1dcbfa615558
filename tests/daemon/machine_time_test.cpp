// SPDX-License-Identifier: Apache-2.0
#include "daemon/machine_time.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <ctime>

namespace locus::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// Uses that much CPU time of this thread; how long it takes by the clock on the wall does not matter.
void work_for(Duration cpu) {
  const Duration end = read_clock(CLOCK_THREAD_CPUTIME_ID) + cpu;
  while (read_clock(CLOCK_THREAD_CPUTIME_ID) < end) {
  }
}

/// A virtual machine is charged for time that its host took away: more may be measured than was used, but not less.
void expect_about(Duration measured, Duration expected) {
  EXPECT_GT(to_seconds(measured), 0.95 * to_seconds(expected));
  EXPECT_LT(to_seconds(measured), 1.5 * to_seconds(expected));
}

TEST(StageStopwatch, InnerStageIsNotChargedToTheOuter) {
  StageStopwatch stopwatch;
  {
    const StageScope filter(&stopwatch, Stage::filter);
    work_for(milliseconds{10});
    {
      const StageScope covariance(&stopwatch, Stage::covariance);
      work_for(milliseconds{30});
    }
    work_for(milliseconds{10});
  }
  work_for(milliseconds{20}); // in no stage
  expect_about(stopwatch.total(Stage::filter), milliseconds{20});
  expect_about(stopwatch.total(Stage::covariance), milliseconds{30});
  EXPECT_EQ(stopwatch.total(Stage::map), Duration::zero());
}

TEST(StageStopwatch, WhatIsDoneInAPauseBelongsToNoStage) {
  StageStopwatch stopwatch;
  {
    const StageScope filter(&stopwatch, Stage::filter);
    work_for(milliseconds{10});
    const StageStopwatch::Pause pause(stopwatch);
    work_for(milliseconds{30});
  }
  expect_about(stopwatch.total(Stage::filter), milliseconds{10});
}

TEST(StageStopwatch, LapHoldsWhatWasSpentSinceTheLastOne) {
  StageStopwatch stopwatch;
  const auto work_in_filter_for = [&](Duration cpu) {
    const StageScope filter(&stopwatch, Stage::filter);
    work_for(cpu);
  };
  work_in_filter_for(milliseconds{30});
  expect_about(stopwatch.lap()[static_cast<std::size_t>(Stage::filter)], milliseconds{30});
  work_in_filter_for(milliseconds{10});
  const StageTimes lap = stopwatch.lap();
  expect_about(lap[static_cast<std::size_t>(Stage::filter)], milliseconds{10});
  EXPECT_EQ(lap[static_cast<std::size_t>(Stage::map)], Duration::zero());
}

TEST(StageStopwatch, VisitsThatAreNotTimedCountLikeThoseThatAre) {
  StageStopwatch stopwatch;
  for (int packet = 0; packet < 200; ++packet) {
    {
      const StageScope decode(&stopwatch, Stage::decode);
      work_for(microseconds{400});
    }
    const StageScope correct(&stopwatch, Stage::correct);
    work_for(microseconds{800});
    if (packet % 50 == 0) {
      const StageScope filter(&stopwatch, Stage::filter);
      work_for(milliseconds{5});
    }
  }
  expect_about(stopwatch.total(Stage::decode), milliseconds{80});
  expect_about(stopwatch.total(Stage::correct), milliseconds{160});
  expect_about(stopwatch.total(Stage::filter), milliseconds{20});
}

} // namespace
} // namespace locus::daemon
