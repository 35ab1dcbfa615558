// SPDX-License-Identifier: Apache-2.0
// Resuming from the final state of another run, in a map that does not fit.
#include "core/odometry/relocation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/odometry/robot_of_restarts.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// The first two seconds of a drive through a tunnel, and the final state of another run in a different place.
class AnotherPlace : public testing::Test {
 protected:
  [[nodiscard]] std::vector<OdometryEstimate> go_on_from(const ResumeState& last,
                                                         Duration wheels_are_silent_for = {}) const {
    RobotSetup robot = robot_of_restarts();
    robot.is_silent = [&](std::size_t source, Stamp now) {
      return source == 0 && now < trajectory_.start() + wheels_are_silent_for;
    };
    Odometry odometry(robot.odometry(), robot.motion_sources());
    odometry.begin_at(last, wall_);
    odometry.recall(last.learned, 3.0);
    std::vector<OdometryEstimate> estimates;
    drive(sim::tunnel(60), trajectory_, robot, seconds{2},
          [&](const Sweep& sweep) { estimates.push_back(odometry.process(sweep)); });
    return estimates;
  }

  sim::Trajectory trajectory_{sim::weaving_course(seconds{5}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0)};
  std::vector<SurfacePoint> wall_ = std::vector<SurfacePoint>(100, {{40, 0, 0}, {1, 0, 0}});
  ResumeState last_{.stamp = trajectory_.start() - seconds{3},
                    .T_odom_base = {Eigen::Quaterniond::Identity(), {7, 0, 0}}};
};

TEST_F(AnotherPlace, WheelsDetermineThePose) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}}; // each starts at its own origin
  const std::vector<OdometryEstimate> estimates = go_on_from(last_);
  EXPECT_EQ(estimates.front().beginning, Beginning::odometry);
  EXPECT_NEAR(estimates.front().T_odom_base.translation.x(), 9, 0.2);
  for (const OdometryEstimate& estimate : estimates)
    EXPECT_GT(estimate.pose_covariance(0, 0), 2.0 * 2.0) << "nothing confirms it, and the robot had been at rest";
  EXPECT_GT(estimates.front().twist_covariance(0, 0), 1.0) << "nobody has seen it move yet";
}

TEST_F(AnotherPlace, WheelsThatSlippedAreLessCertain) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}};
  last_.twist_base[0] = 1.0;
  const double sound_sigma = std::sqrt(go_on_from(last_).front().pose_covariance(0, 0));
  last_.doubted.set(0);
  const OdometryEstimate first = go_on_from(last_).front();
  EXPECT_EQ(first.beginning, Beginning::odometry);
  EXPECT_GT(std::sqrt(first.pose_covariance(0, 0)), sound_sigma + 1.5);
}

TEST_F(AnotherPlace, UnreachableWheelPoseIsDiscarded) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-200, 0, 0}};
  const OdometryEstimate first = go_on_from(last_).front();
  EXPECT_EQ(first.beginning, Beginning::origin);
  EXPECT_EQ(first.T_odom_base.translation.norm(), 0);
}

TEST_F(AnotherPlace, RestartedOdometryIsSkipped) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-200, 0, 0}};
  last_.T_source_base[2] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}};
  SensedMotion sensed;
  sensed.sources[0].usable = sensed.sources[2].usable = true;
  const std::vector<Candidate> candidates = last_.candidates(last_.stamp + seconds{3}, sensed, 10);
  EXPECT_TRUE(candidates.front().from_odometry);
  EXPECT_NEAR(candidates.front().T_odom_base.translation.x(), 9, 1e-9);
  EXPECT_FALSE(candidates[1].from_odometry);
}

TEST_F(AnotherPlace, HealthyOdometryIsPreferred) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-1, 0, 0}};
  last_.T_source_base[2] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}};
  last_.twist_base[0] = 0.3;
  last_.doubted.set(0);
  SensedMotion sensed;
  sensed.sources[0].usable = sensed.sources[2].usable = true;
  const std::vector<Candidate> candidates = last_.candidates(last_.stamp + seconds{3}, sensed, 10);
  EXPECT_TRUE(candidates[0].from_healthy);
  EXPECT_NEAR(candidates[0].T_odom_base.translation.x(), 9, 1e-9);
  EXPECT_TRUE(candidates[1].from_odometry && !candidates[1].from_healthy);
  EXPECT_NEAR(candidates[1].T_odom_base.translation.x(), 8, 1e-9);
}

TEST_F(AnotherPlace, UnhealthyOdometryIsTheLastResort) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}};
  last_.doubted.set(0);
  EXPECT_EQ(go_on_from(last_).front().beginning, Beginning::odometry) << "it stood, and is not seen there any more";
}

TEST_F(AnotherPlace, CalibrationOfAnAbsentSourceIsRetained) {
  last_.learned[0] = LearnedSource{.noise_per_s = Vector6::Constant(0.01), .states = {0.05, 0, 0, 0, 0, 0, 0}};
  const std::vector<OdometryEstimate> estimates = go_on_from(last_, milliseconds{500});
  ASSERT_TRUE(estimates[0].sources[0].learned && estimates[2].sources[0].learned);
  EXPECT_NEAR(estimates[2].sources[0].learned->states[0], 0.05, 0.05 / 1000) << "fades to its prior within hours";
  EXPECT_FALSE(estimates[2].sources[3].learned) << "there is no such source";
}

TEST_F(AnotherPlace, RobotAtRestMayStillBeThere) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-1, 0, 0}};
  SensedMotion sensed;
  sensed.sources[0].usable = true;
  const std::vector<Candidate> sound = last_.candidates(last_.stamp + seconds{3}, sensed, 10);
  EXPECT_TRUE(sound[0].from_healthy);
  EXPECT_EQ(sound[1].T_odom_base.translation.x(), 7);
  EXPECT_LT(sound[1].sigma[0], 0.1);
  last_.doubted.set(0);
  EXPECT_EQ(last_.candidates(last_.stamp + seconds{3}, sensed, 10).front().T_odom_base.translation.x(), 7);
}

TEST_F(AnotherPlace, AnotherOdometryIsAwaitedWhereOneWasRestarted) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-200, 0, 0}};
  last_.T_source_base[2] = Pose{};
  const std::vector<OdometryEstimate> estimates = go_on_from(last_);
  EXPECT_FALSE(estimates[5].beginning);
  EXPECT_EQ(estimates.back().beginning, Beginning::origin) << "it never comes";
}

TEST_F(AnotherPlace, OdometryThatIsNotHealthyIsAwaited) {
  SensedMotion sensed;
  EXPECT_FALSE(last_.awaits(sensed)) << "there was none";
  last_.T_source_base[0] = Pose{};
  sensed.sources[0].known = true;
  EXPECT_TRUE(last_.awaits(sensed));
  sensed.sources[0].usable = true;
  EXPECT_FALSE(last_.awaits(sensed));
}

TEST_F(AnotherPlace, WaitsForWheelsAtMostOneSecond) {
  last_.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {-2, 0, 0}};
  for (const auto& [silent_for, waits_at_least, from] :
       {std::tuple{milliseconds{500}, 3, Beginning::odometry}, std::tuple{milliseconds{5000}, 9, Beginning::origin}}) {
    const std::vector<OdometryEstimate> estimates = go_on_from(last_, silent_for);
    const auto begun = std::ranges::find_if(estimates, [](const auto& e) { return e.beginning.has_value(); });
    ASSERT_NE(begun, estimates.end());
    EXPECT_GE(begun - estimates.begin(), waits_at_least);
    EXPECT_LE(begun - estimates.begin(), waits_at_least + 3);
    EXPECT_EQ(begun->beginning, from);
    EXPECT_EQ(estimates.front().state, TrackingState::dead_reckoning);
    EXPECT_EQ(estimates.front().T_odom_base.translation.x(), 7) << "meanwhile it is where it was";
  }
}

} // namespace
} // namespace locus::test
