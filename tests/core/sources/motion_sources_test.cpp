// SPDX-License-Identifier: Apache-2.0
#include "core/sources/motion_sources.hpp"

#include <limits>

#include <gtest/gtest.h>

#include "core/stamps.hpp"

namespace locus {
namespace {

using std::chrono::milliseconds;

const std::vector<MotionSourceOptions> kWheelsImuVisual{
    {"wheels", SourceKind::odometry, {}}, {"imu", SourceKind::imu, {}}, {"visual", SourceKind::odometry, {}}};

/// Wheels that report 1 m/s and no rotation, a gyro that reports 1 rad/s, visual odometry that reports 2 m/s and 2
/// rad/s.
class MotionSourcesTest : public testing::Test {
 protected:
  static void feed(MotionSources& sources, std::size_t source, int from_ms, int to_ms) {
    for (int ms = from_ms; ms <= to_ms; ms += 20) {
      const Stamp stamp = at_ms(ms);
      const double t_s = 1e-3 * ms;
      if (source == 0)
        sources.add(SourceId{0}, OdometrySample{stamp, stamp, {Eigen::Quaterniond::Identity(), {t_s, 0, 0}}, 1.0});
      else if (source == 1)
        sources.add(SourceId{1},
                    ImuSample{stamp, stamp, {0, 0, 1.0}, {1e-6 * ms, 0, 9.81}, {}}); // no two samples are equal
      else
        sources.add(SourceId{2}, OdometrySample{stamp, stamp, {so3_exp({0, 0, 2 * t_s}), {2 * t_s, 0, 0}}, 1.0});
    }
  }
  /// Lidar sees a turn in the opposite direction of the gyro's.
  static void contradict_gyro(MotionSources& sources, int to_ms) {
    RegistrationFeedback seen{
        .from = at_ms(to_ms - 100), .to = at_ms(to_ms), .opinions = {}, .twist_base = Vector6::Zero(), .observes = {}};
    seen.observes.fill(true);
    seen.twist_base[5] = -1.0;
    sources.on_feedback(seen);
  }
};

TEST_F(MotionSourcesTest, CombinedTakesRotationFromTheGyroAndTranslationFromTheOdometry) {
  MotionSources sources(kWheelsImuVisual, Fusion::combined);
  for (const std::size_t source : {0U, 1U, 2U})
    feed(sources, source, 0, 1000);
  const SourceChoice choice = sources.choose(at_ms(1000));
  EXPECT_EQ(choice.rotation, SourceId{1});
  EXPECT_EQ(choice.translation, SourceId{0});
  EXPECT_EQ(choice.uncorrected(), Uncorrected::nothing);
  const auto T = sources.motion(choice, at_ms(400), at_ms(500));
  ASSERT_TRUE(T);
  EXPECT_NEAR(T->translation.x(), 0.1, 1e-9);
  EXPECT_NEAR(so3_log(T->rotation).z(), 0.1, 1e-9);
}

TEST_F(MotionSourcesTest, QueueTakesAllFromTheFirstHealthyOne) {
  MotionSources sources(kWheelsImuVisual, Fusion::queue);
  for (const std::size_t source : {0U, 1U, 2U})
    feed(sources, source, 0, 1000);
  const SourceChoice choice = sources.choose(at_ms(1000));
  EXPECT_EQ(choice.rotation, SourceId{0});
  EXPECT_EQ(choice.translation, SourceId{0});
  EXPECT_NEAR(so3_log(sources.motion(choice, at_ms(400), at_ms(500))->rotation).z(), 0.0, 1e-12);
}

TEST_F(MotionSourcesTest, InertialSourceFirstInTheQueueLeavesTranslationOpen) {
  MotionSources sources({kWheelsImuVisual[1], kWheelsImuVisual[0]}, Fusion::queue);
  for (const int ms : {0, 10}) {
    sources.add(SourceId{0}, ImuSample{at_ms(ms), at_ms(ms), {0, 0, 1.0}, {1e-6 * ms, 0, 9.81}, {}});
    sources.add(SourceId{1}, OdometrySample{at_ms(ms), at_ms(ms), {}, 1.0});
  }
  const SourceChoice choice = sources.choose(at_ms(20));
  EXPECT_EQ(choice.rotation, SourceId{0});
  EXPECT_FALSE(choice.translation);
  EXPECT_EQ(choice.uncorrected(), Uncorrected::translation);
}

TEST_F(MotionSourcesTest, ASilentSourceIsNotChosen) {
  MotionSources sources(kWheelsImuVisual, Fusion::queue);
  feed(sources, 0, 0, 1000);
  feed(sources, 2, 0, 2500);
  const Stamp silent_since = at_ms(1000);
  EXPECT_EQ(sources.choose(silent_since + MotionTrack::kMaxExtrapolation).translation, SourceId{0});
  EXPECT_EQ(sources.choose(silent_since + MotionTrack::kMaxExtrapolation + milliseconds{1}).translation, SourceId{2});
}

// Its track has zero velocity between the end of a sample's extrapolation and the next sample: half of a sweep would
// count as standstill.
TEST_F(MotionSourcesTest, SourceSlowerThanTheExtrapolationIsNotChosen) {
  MotionSources sources(kWheelsImuVisual, Fusion::queue);
  for (int ms = 0; ms <= 1000; ms += 100)
    sources.add(SourceId{0},
                OdometrySample{at_ms(ms), at_ms(ms), {Eigen::Quaterniond::Identity(), {1e-3 * ms, 0, 0}}, 1.0});
  EXPECT_FALSE(sources.choose(at_ms(1000)).translation);
}

TEST_F(MotionSourcesTest, ImuTooSlowForASweepIsNeitherUsedNorBlamed) {
  int events = 0;
  MotionSources sources({{"imu", SourceKind::imu, {}}}, Fusion::combined, {}, [&](const HealthEvent&) { ++events; });
  for (int i = 0; i < 100; ++i) {
    const Stamp stamp = at_ms(50 * i - i % 2); // 20 Hz with jitter
    sources.add(SourceId{0}, ImuSample{stamp, stamp, {0, 0, 1.0}, {1e-6 * i, 0, 9.81}, {}});
    if (i % 2 == 0)
      contradict_gyro(sources, 50 * i);
  }
  EXPECT_EQ(events, 0);
  EXPECT_TRUE(sources.health(SourceId{0}).healthy());
  EXPECT_FALSE(sources.choose(at_ms(4960)).rotation);
  const SensedMotion sensed = sources.sensed_in(at_ms(4800), at_ms(4900));
  EXPECT_TRUE(sensed.sources[0].known);
  EXPECT_FALSE(sensed.sources[0].usable);
  EXPECT_FALSE(sensed.specific_force);
}

TEST_F(MotionSourcesTest, WithoutAnySourceNothingIsCorrected) {
  const MotionSources sources({}, Fusion::combined);
  const SourceChoice choice = sources.choose(at_ms(0));
  EXPECT_FALSE(choice.rotation);
  EXPECT_FALSE(choice.translation);
  EXPECT_EQ(choice.uncorrected(), Uncorrected::all);
  EXPECT_EQ(*sources.motion(choice, at_ms(0), at_ms(100)), Pose{});
}

TEST_F(MotionSourcesTest, NoMotionBeyondATrack) {
  MotionSources sources(kWheelsImuVisual, Fusion::combined);
  feed(sources, 0, 0, 1000);
  feed(sources, 1, 500, 1000);
  const SourceChoice choice = sources.choose(at_ms(1000));
  EXPECT_TRUE(sources.motion(choice, at_ms(500), at_ms(600)));
  EXPECT_FALSE(sources.motion(choice, at_ms(400), at_ms(600)));
}

TEST_F(MotionSourcesTest, SensesThePoseOfEverySourceReceivedDuringTheSweep) {
  MotionSources sources(kWheelsImuVisual, Fusion::queue);
  feed(sources, 0, 0, 1000);
  feed(sources, 1, 0, 1000);
  feed(sources, 2, 0, 800);
  const SensedMotion motion = sources.sensed_in(at_ms(900), at_ms(1000));
  EXPECT_TRUE(motion.sources[0].usable);
  EXPECT_TRUE(motion.sources[1].usable);
  EXPECT_FALSE(motion.sources[2].usable);
  EXPECT_FALSE(motion.sources[3].usable) << "there is no such source";
  EXPECT_NEAR(motion.sources[0].T_source_base.translation.x(), 1.0, 1e-12);
  EXPECT_NEAR(so3_log(motion.sources[1].T_source_base.rotation).z(), 1.0, 1e-6);
  ASSERT_TRUE(motion.specific_force);
  EXPECT_NEAR(motion.specific_force->mean_base_mps2().z(), 9.81, 1e-12);

  const SensedMotion silence = sources.sensed_in(at_ms(2000), at_ms(2100));
  EXPECT_FALSE(silence.sources[0].usable);
  EXPECT_FALSE(silence.specific_force);
}

TEST_F(MotionSourcesTest, DisabledAccelerometerLeavesItsGyroInUse) {
  std::vector<MotionSourceOptions> options = kWheelsImuVisual;
  options[1].use_acceleration = UseAcceleration::off;
  MotionSources sources(options, Fusion::queue);
  feed(sources, 1, 0, 1000);
  const SensedMotion motion = sources.sensed_in(at_ms(900), at_ms(1000));
  EXPECT_TRUE(motion.sources[1].usable);
  EXPECT_FALSE(motion.specific_force);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  MotionSources broken(options, Fusion::queue);
  for (int ms = 0; ms <= 3000; ms += 5)
    broken.add(SourceId{1}, ImuSample{at_ms(ms), at_ms(ms), Eigen::Vector3d::Zero(), {nan, 0, -300}, std::nullopt});
  EXPECT_TRUE(broken.health(SourceId{1}).healthy());
  EXPECT_EQ(broken.health(SourceId{1}).verdict(), "");
}

TEST_F(MotionSourcesTest, UnhealthySourceIsKnownButUnusable) {
  MotionSources sources(kWheelsImuVisual, Fusion::combined);
  feed(sources, 0, 0, 1000);
  sources.set_outside_verdict(SourceId{0}, false);
  sources.set_outside_verdict(SourceId{0}, true);
  feed(sources, 0, 1020, 1100); // on probation
  const SensedMotion motion = sources.sensed_in(at_ms(1000), at_ms(1100));
  EXPECT_TRUE(motion.sources[0].known);
  EXPECT_FALSE(motion.sources[0].usable);
  EXPECT_EQ(motion.sources[0].epoch, 1U);
  EXPECT_FALSE(sources.choose(at_ms(1100)).translation);
}

TEST_F(MotionSourcesTest, EachHealthChangeIsReportedOnce) {
  std::vector<HealthEvent> events;
  MotionSources sources(kWheelsImuVisual, Fusion::combined, {},
                        [&](const HealthEvent& event) { events.push_back(event); });
  feed(sources, 0, 0, 1000);
  feed(sources, 2, 0, 1000);
  for (int ms = 1000; ms <= 1500; ms += 10) {
    sources.advance(at_ms(ms));
    if (ms % 20 == 0)
      feed(sources, 0, ms, ms);
  }
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].source, SourceId{2});
  EXPECT_EQ(events[0].stamp, at_ms(1070));
  EXPECT_FALSE(events[0].healthy);
  feed(sources, 2, 1520, 2540);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[1].source, SourceId{2});
  EXPECT_TRUE(events[1].healthy);
}

/// Regression: a step back cost them as much time as the step, because their samples were older than the last ones.
TEST_F(MotionSourcesTest, HostClockStepCostsTwoSeconds) {
  for (const int step_ms : {-3'600'000, 3'600'000}) {
    MotionSources sources(kWheelsImuVisual, Fusion::combined);
    for (const int from_ms : {0, step_ms}) {
      for (int ms = from_ms; ms <= from_ms + 2000; ms += 20) {
        feed(sources, 0, ms, ms);
        feed(sources, 1, ms, ms);
        sources.advance(at_ms(ms));
      }
    }
    const SourceChoice choice = sources.choose(at_ms(step_ms + 2000));
    EXPECT_EQ(choice.rotation, SourceId{1}) << step_ms;
    EXPECT_EQ(choice.translation, SourceId{0}) << step_ms;
    EXPECT_TRUE(sources.motion(choice, at_ms(step_ms + 1900), at_ms(step_ms + 2000))) << step_ms;
  }
}

TEST_F(MotionSourcesTest, SelfCheckFindingIsReportedInWords) {
  std::vector<HealthEvent> events;
  MotionSources sources(kWheelsImuVisual, Fusion::combined, {},
                        [&](const HealthEvent& event) { events.push_back(event); });
  for (int ms = 0; ms < 2000; ms += 100) {
    feed(sources, 1, ms, ms + 80);
    contradict_gyro(sources, ms);
  }
  ASSERT_EQ(events.size(), 2U);
  for (const HealthEvent& event : events) {
    EXPECT_EQ(event.source, SourceId{1});
    EXPECT_FALSE(event.healthy);
    EXPECT_EQ(event.reason, HealthReason::self_check);
  }
  EXPECT_NE(events.front().verdict.find("until"), std::string_view::npos) << "set aside";
  EXPECT_NE(events.back().verdict.find("other way"), std::string_view::npos) << "refused";
  EXPECT_EQ(sources.health(SourceId{1}).verdict(), events.back().verdict);
  EXPECT_EQ(sources.health(SourceId{1}).counters().health_changes, 1U);
}

} // namespace
} // namespace locus
