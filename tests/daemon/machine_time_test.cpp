// SPDX-License-Identifier: Apache-2.0
#include "daemon/machine_time.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <ctime>

namespace locus::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// CPU time of a thread that only runs work_for() and reads its clock, which takes time, too.
class WorkingThread {
 public:
  static void work_for(Duration cpu) { now_ += cpu; }
  static Duration clock(clockid_t /*id*/) { return now_ += std::chrono::nanoseconds{400}; }

 private:
  static inline Duration now_{};
};

constexpr auto work_for = WorkingThread::work_for;

TEST(StageStopwatch, InnerStageIsNotChargedToTheOuter) {
  StageStopwatch stopwatch(WorkingThread::clock);
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
  EXPECT_EQ(stopwatch.total(Stage::filter), milliseconds{20});
  EXPECT_EQ(stopwatch.total(Stage::covariance), milliseconds{30});
  EXPECT_EQ(stopwatch.total(Stage::map), Duration::zero());
}

TEST(StageStopwatch, PauseIsChargedToNoStage) {
  StageStopwatch stopwatch(WorkingThread::clock);
  {
    const StageScope filter(&stopwatch, Stage::filter);
    work_for(milliseconds{10});
    const StageStopwatch::Pause pause(stopwatch);
    work_for(milliseconds{30});
  }
  EXPECT_EQ(stopwatch.total(Stage::filter), milliseconds{10});
}

TEST(StageStopwatch, LapReturnsTheTimeSinceTheLastOne) {
  StageStopwatch stopwatch(WorkingThread::clock);
  const auto work_in_filter_for = [&](Duration cpu) {
    const StageScope filter(&stopwatch, Stage::filter);
    work_for(cpu);
  };
  work_in_filter_for(milliseconds{30});
  EXPECT_EQ(stopwatch.lap()[static_cast<std::size_t>(Stage::filter)], milliseconds{30});
  work_in_filter_for(milliseconds{10});
  const StageTimes lap = stopwatch.lap();
  EXPECT_EQ(lap[static_cast<std::size_t>(Stage::filter)], milliseconds{10});
  EXPECT_EQ(lap[static_cast<std::size_t>(Stage::map)], Duration::zero());
}

TEST(StageStopwatch, UntimedVisitsAreExtrapolated) {
  StageStopwatch stopwatch(WorkingThread::clock);
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
  EXPECT_EQ(stopwatch.total(Stage::decode), milliseconds{80});
  EXPECT_EQ(stopwatch.total(Stage::correct), milliseconds{160});
  EXPECT_EQ(stopwatch.total(Stage::filter), milliseconds{20});
}

/// The default clock is that of the calling thread.
TEST(StageStopwatch, CountsTimeOfItsThreadOnly) {
  StageStopwatch stopwatch;
  const Duration before = read_clock(CLOCK_THREAD_CPUTIME_ID);
  {
    const StageScope filter(&stopwatch, Stage::filter);
    const Duration begin = read_clock(CLOCK_THREAD_CPUTIME_ID);
    while (read_clock(CLOCK_THREAD_CPUTIME_ID) < begin + milliseconds{5}) {
    }
  }
  EXPECT_GT(stopwatch.total(Stage::filter), milliseconds{4});
  EXPECT_LE(stopwatch.total(Stage::filter), read_clock(CLOCK_THREAD_CPUTIME_ID) - before);
}

} // namespace
} // namespace locus::daemon
