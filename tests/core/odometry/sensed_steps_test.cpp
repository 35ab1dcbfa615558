// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/sensed_steps.hpp"

#include <gtest/gtest.h>

namespace locus {
namespace {

using std::chrono::milliseconds;

constexpr SourceId kSource{1}, kOther{0};
const Vector6 kTwist = (Vector6() << 1.0, 0.1, -0.05, 0.02, -0.03, 0.4).finished();
const Pose kBegin{so3_exp({0.1, 0.2, 0.3}), {4, 5, 6}}; ///< in the source's own frame

/// The source has moved with kTwist for this time.
Sweep sweep_at(Duration elapsed) {
  Sweep sweep;
  sweep.end = stamp_from_ns(1'000'000'000) + elapsed;
  sweep.motion.sources[index_of(kSource)] = {
      .known = true, .usable = true, .epoch = 3, .T_source_base = kBegin * se3_exp(to_seconds(elapsed) * kTwist)};
  return sweep;
}
SensedSteps begun() {
  SensedSteps steps;
  steps.store(sweep_at(milliseconds{0}));
  return steps;
}

TEST(SensedSteps, AreMeanTwistsOverDroppedSweeps) {
  const SensedSteps steps = begun();
  for (const int elapsed_ms : {50, 100, 1000}) {
    const Sweep sweep = sweep_at(milliseconds{elapsed_ms});
    EXPECT_DOUBLE_EQ(steps.elapsed_s(sweep), 1e-3 * elapsed_ms);
    const auto twist_base = steps.twist_base(sweep, kSource);
    ASSERT_TRUE(twist_base);
    EXPECT_LT((twist_base->mean - kTwist).norm(), 1e-9) << elapsed_ms;
    EXPECT_TRUE(steps.is_usable(sweep, kSource));
  }
}

TEST(SensedSteps, StartAtTheStoredSweep) {
  SensedSteps steps = begun();
  const Sweep second = sweep_at(milliseconds{100});
  steps.store(second);
  EXPECT_EQ(steps.last(), second.end);
  EXPECT_DOUBLE_EQ(steps.elapsed_s(sweep_at(milliseconds{250})), 0.15);
  EXPECT_LT((steps.twist_base(sweep_at(milliseconds{250}), kSource)->mean - kTwist).norm(), 1e-9);
}

TEST(SensedSteps, ReportTwistChangeAndCorrectedLateness) {
  Sweep first = sweep_at(milliseconds{0}), second = sweep_at(milliseconds{100});
  SourcePose& began = first.motion.sources[index_of(kSource)];
  SourcePose& ended = second.motion.sources[index_of(kSource)];
  began.twist_base = kTwist;
  ended.twist_base = 3.0 * kTwist;
  began.late = milliseconds{10};
  ended.late = milliseconds{40};
  SensedSteps steps;
  steps.store(first);
  const auto sensed = steps.twist_base(second, kSource);
  ASSERT_TRUE(sensed);
  EXPECT_LT((sensed->change_per_s - 20.0 * kTwist).norm(), 1e-9);
  EXPECT_LT((sensed->brought_forward - (0.04 * 3.0 - 0.01) / 0.1 * kTwist).norm(), 1e-9);
}

TEST(SensedSteps, AreEmptyIfTheSourceIsAbsent) {
  const SensedSteps steps = begun();
  Sweep sweep = sweep_at(milliseconds{100});
  EXPECT_FALSE(steps.twist_base(sweep, kOther)) << "never";
  sweep.motion.sources[index_of(kSource)].known = false;
  EXPECT_FALSE(steps.twist_base(sweep, kSource)) << "not now";
  EXPECT_FALSE(steps.is_usable(sweep, kSource));
  SensedSteps silent;
  silent.store(sweep);
  EXPECT_FALSE(silent.twist_base(sweep_at(milliseconds{200}), kSource)) << "not then";
}

TEST(SensedSteps, AreEmptyAcrossEpochs) {
  Sweep sweep = sweep_at(milliseconds{100});
  ++sweep.motion.sources[index_of(kSource)].epoch;
  EXPECT_FALSE(begun().twist_base(sweep, kSource));
  EXPECT_FALSE(begun().is_usable(sweep, kSource));
}

TEST(SensedSteps, AreEmptyForZeroDuration) {
  EXPECT_FALSE(begun().twist_base(sweep_at(milliseconds{0}), kSource));
  EXPECT_FALSE(begun().twist_base(sweep_at(milliseconds{-100}), kSource)) << "nor backwards";
}

TEST(SensedSteps, OfAnUnhealthySourceAreKnownButUnusable) {
  Sweep sick = sweep_at(milliseconds{100});
  sick.motion.sources[index_of(kSource)].usable = false;
  EXPECT_TRUE(begun().twist_base(sick, kSource));
  EXPECT_FALSE(begun().is_usable(sick, kSource));
  SensedSteps steps;
  steps.store(sick);
  EXPECT_TRUE(steps.twist_base(sweep_at(milliseconds{200}), kSource));
  EXPECT_FALSE(steps.is_usable(sweep_at(milliseconds{200}), kSource)) << "it has only just recovered";
}

} // namespace
} // namespace locus
