// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <list>
#include <optional>
#include <utility>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/odometry/robot_of_restarts.hpp"
#include "core/robot.hpp"
#include "locus_sim/driver.hpp"
#include "locus_sim/world.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// State that one odometry hands over to the next.
struct Legacy {
  Pose T_odom_base;
  std::vector<SurfacePoint> map_odom;
};

Legacy legacy_of(const Odometry& odometry, const Pose& T_odom_base) {
  Legacy legacy{T_odom_base, {}};
  read_planes(odometry.map().fine(), legacy.map_odom);
  return legacy;
}

/// A robot whose odometry ends every three seconds and restarts with the next sweep.
class Restarts {
 public:
  Restarts(const sim::Scene& scene, const sim::Trajectory& trajectory, Duration duration) {
    const RobotSetup robot = robot_of_restarts();
    options_ = robot.odometry();
    sources_ = robot.motion_sources();
    Odometry odometry(options_, sources_);
    int sweeps = 0;
    drive(scene, trajectory, robot, duration, [&](const Sweep& sweep) {
      const bool restarts = ++sweeps % 30 == 0;
      const Pose T_odom_base = odometry.process(sweep).T_odom_base;
      if (restarts)
        begin_anew(sweep, T_odom_base);
      else if (sweeps % 30 == 29)
        legacies_.push_back(legacy_of(odometry, T_odom_base));
    });
  }

  [[nodiscard]] std::size_t all() const { return legacies_.size(); }
  int found = 0, found_aside = 0, found_ahead = 0, found_where_it_was_long_ago = 0;

 private:
  void begin_anew(const Sweep& sweep, const Pose& T_odom_base) {
    const Legacy& last = legacies_.back();
    const std::optional<Pose> T_odom_found = find(sweep, last.T_odom_base, last);
    found += T_odom_found ? 1 : 0;
    if (T_odom_found) {
      EXPECT_LT((T_odom_found->translation - T_odom_base.translation).norm(), 0.1);
    }
    for (const double away_m : {-3.0, 3.0}) {
      const Eigen::Quaterniond level = Eigen::Quaterniond::Identity();
      found_ahead += find(sweep, last.T_odom_base * Pose{level, {away_m, 0, 0}}, last) ? 1 : 0;
      found_aside += find(sweep, last.T_odom_base * Pose{level, {0, away_m, 0}}, last) ? 1 : 0;
    }
    for (const Legacy& old : legacies_)
      if ((old.T_odom_base.translation - T_odom_base.translation).norm() > 5)
        found_where_it_was_long_ago += find(sweep, old.T_odom_base, old) ? 1 : 0;
  }

  [[nodiscard]] std::optional<Pose> find(const Sweep& sweep, const Pose& T_odom_expected, const Legacy& legacy) const {
    Odometry odometry(options_, sources_);
    odometry.begin_at({.stamp = sweep.end, .T_odom_base = T_odom_expected}, legacy.map_odom);
    const OdometryEstimate estimate = odometry.process(sweep);
    return estimate.beginning == Beginning::map ? std::optional{estimate.T_odom_base} : std::nullopt;
  }

  OdometryOptions options_;
  std::vector<MotionSourceOptions> sources_;
  std::vector<Legacy> legacies_;
};

/// Outcome of the restarts after gaps without odometry.
struct Gaps {
  int all = 0;
  int found = 0, bridged = 0; ///< relocalised in the map, or bridged by the wheels, to 50 mm and 2 % of the distance
  int elsewhere = 0;          ///< relocalised in the map at a wrong pose
  double worst_sigma = 0;     ///< of the resumed ones
};

/// Odometry that spans a gap. Spinning wheels (`spun`) are in doubt when the odometry ends, and continue to spin for a
/// moment. A scale error of 10 % is learned by the first odometry and handed over (`learned`) or withheld
/// (`not_learned`).
enum class Wheels { none, sound, spun, learned, not_learned };

/// Ends the odometry every second; another one starts after `gap`.
Gaps drive_with_gaps(const sim::Scene& scene, const sim::Trajectory& trajectory, Duration gap, Wheels wheels) {
  RobotSetup robot = robot_of_restarts();
  if (wheels == Wheels::learned || wheels == Wheels::not_learned)
    robot.wheels->scale_error = 0.1;
  Odometry odometry(robot.odometry(), robot.motion_sources());
  ResumeState now;
  std::deque<std::pair<ResumeState, std::vector<SurfacePoint>>> ended;
  Gaps gaps;
  int sweeps = 0;
  drive(scene, trajectory, robot, seconds{26}, [&](const Sweep& sweep) {
    const OdometryEstimate estimate = odometry.process(sweep);
    odometry.prepare_next();
    now = now.followed_by(estimate);
    if (++sweeps % 10 == 0)
      ended.emplace_back(now, legacy_of(odometry, now.T_odom_base).map_odom);
    if (ended.empty() || sweep.end - ended.front().first.stamp < gap)
      return;
    auto [last, map] = ended.front();
    ended.pop_front();
    if (wheels == Wheels::none)
      last.T_source_base = {};
    if (wheels == Wheels::not_learned)
      last.learned = {};
    if (wheels == Wheels::spun) {
      last.doubted.set(0);
      last.T_source_base[0] = *last.T_source_base[0] * Pose{Eigen::Quaterniond::Identity(), {-0.8, 0, 0}};
    }
    Odometry next(robot.odometry(), robot.motion_sources());
    next.begin_at(last, map);
    const OdometryEstimate begun = next.process(sweep);
    const double way_m = (estimate.T_odom_base.translation - last.T_odom_base.translation).norm();
    const double off_m = (begun.T_odom_base.translation - estimate.T_odom_base.translation).norm();
    const bool is_there = off_m < 0.05 + 0.02 * way_m;
    ++gaps.all;
    gaps.found += begun.beginning == Beginning::map && is_there ? 1 : 0;
    gaps.bridged += begun.beginning == Beginning::odometry && is_there ? 1 : 0;
    gaps.elsewhere += begun.beginning == Beginning::map && !is_there ? 1 : 0;
    const Eigen::Array3d sigma = begun.pose_covariance.diagonal().head<3>().cwiseSqrt();
    const Eigen::Array3d error = begun.T_odom_base.translation - estimate.T_odom_base.translation;
    if (begun.beginning != Beginning::origin)
      gaps.worst_sigma = std::max(gaps.worst_sigma, (error / sigma).abs().maxCoeff());
  });
  return gaps;
}

/// Half of the lidar's points there are far, newly visible or moving.
TEST(Relocation, PlantIsRelocalisedOnlyAtTheTruePose) {
  const sim::World plant = sim::make_urban(1);
  sim::Dice dice(1);
  const sim::PlannedCourse planned = plan_course(plant.roads, {1.0, 0.8, 0.5, 1.0, 0.1}, seconds{34}, dice);
  const Restarts restarts(plant.scene, sim::Trajectory(planned.course, planned.start), seconds{31});
  ASSERT_EQ(restarts.all(), 10U);
  EXPECT_GE(restarts.found, 9);
  EXPECT_EQ(restarts.found_ahead, 0);
  EXPECT_EQ(restarts.found_aside, 0);
  EXPECT_EQ(restarts.found_where_it_was_long_ago, 0);
}

TEST(Relocation, TunnelIsRelocalisedOnlyAtTheTruePose) {
  const sim::Course course = sim::weaving_course(seconds{34}, 1.0, 0.3, 12.0);
  const Restarts restarts(sim::tunnel(60), sim::Trajectory(course, sim::weaving_start(5, 0.3, 12.0)), seconds{31});
  ASSERT_EQ(restarts.all(), 10U);
  EXPECT_EQ(restarts.found, 10);
  EXPECT_EQ(restarts.found_ahead, 0);
  EXPECT_EQ(restarts.found_aside, 0);
  EXPECT_EQ(restarts.found_where_it_was_long_ago, 0);
}

/// The position along the corridor is unobservable there; only lateral errors can be rejected.
TEST(Relocation, BareCorridorIsRelocalisedOnlyAtTheTruePose) {
  const sim::Course course = sim::weaving_course(seconds{34}, 1.0, 0.3, 12.0);
  const Restarts restarts(sim::corridor(60, sim::Walls::bare),
                          sim::Trajectory(course, sim::weaving_start(5, 0.3, 12.0)), seconds{31});
  ASSERT_EQ(restarts.all(), 10U);
  EXPECT_EQ(restarts.found, 10);
  EXPECT_EQ(restarts.found_aside, 0);
}

/// The watchdog takes six seconds to end a hanging service, while the robot drives on.
TEST(Relocation, WheelsBridgeSixSeconds) {
  const sim::World plant = sim::make_urban(1);
  sim::Dice dice(1);
  const sim::PlannedCourse planned = plan_course(plant.roads, {1.0, 0.8, 0.5, 1.0, 0.1}, seconds{29}, dice);
  const sim::Trajectory through_plant(planned.course, planned.start);
  const sim::Trajectory weaving(sim::weaving_course(seconds{29}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  for (const Gaps& gaps : {drive_with_gaps(plant.scene, through_plant, seconds{6}, Wheels::sound),
                           drive_with_gaps(sim::tunnel(60), weaving, seconds{6}, Wheels::sound),
                           drive_with_gaps(sim::corridor(60, sim::Walls::bare), weaving, seconds{6}, Wheels::sound)}) {
    EXPECT_GE(gaps.all, 19);
    EXPECT_EQ(gaps.found + gaps.bridged, gaps.all);
    EXPECT_EQ(gaps.elsewhere, 0);
  }
}

/// Without the learned scale, 10 % of six seconds' travel lies outside the search range.
TEST(Relocation, LearnedWheelCalibrationHoldsAfterTheGap) {
  const sim::Trajectory weaving(sim::weaving_course(seconds{29}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  const Gaps learned = drive_with_gaps(sim::tunnel(60), weaving, seconds{6}, Wheels::learned);
  EXPECT_GE(learned.found + learned.bridged, learned.all - 2) << "the first second or two teach little";
  EXPECT_LT(learned.worst_sigma, 3);
  EXPECT_LT(drive_with_gaps(sim::tunnel(60), weaving, seconds{6}, Wheels::not_learned).found, learned.all / 2);
}

TEST(Relocation, WheelsThatSlippedGuideTheSearch) {
  const sim::World plant = sim::make_urban(1);
  sim::Dice dice(1);
  const sim::PlannedCourse planned = plan_course(plant.roads, {1.0, 0.8, 0.5, 1.0, 0.1}, seconds{29}, dice);
  const sim::Trajectory weaving(sim::weaving_course(seconds{29}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  for (const auto& [scene, trajectory] :
       {std::pair{plant.scene, sim::Trajectory(planned.course, planned.start)}, std::pair{sim::tunnel(60), weaving}}) {
    const Gaps spun = drive_with_gaps(scene, trajectory, seconds{6}, Wheels::spun);
    EXPECT_GT(spun.found, drive_with_gaps(scene, trajectory, seconds{6}, Wheels::none).found);
    EXPECT_EQ(spun.elsewhere, 0);
    EXPECT_LT(spun.worst_sigma, 3) << "where the map does not tell";
    RecordProperty("found_of_100", 100 * spun.found / spun.all);
  }
}

/// An odometry that continues where another ended.
struct Successor {
  Successor(const RobotSetup& robot, const ResumeState& last, const std::vector<SurfacePoint>& map_odom)
      : odometry(robot.odometry(), robot.motion_sources()), T_odom_ended(last.T_odom_base) {
    odometry.begin_at(last, map_odom);
  }
  Odometry odometry;
  Pose T_odom_ended;
  int seen = 0; ///< sweeps
};

/// Drives along a corridor. The odometry ends every second, another starts after `gap`, whose sources are received
/// three sweeps after its lidar, as DDS finds them later. Returns the share of those at the true pose a second later.
double share_at_the_true_pose(sim::Walls walls, Duration gap) {
  constexpr int kWithoutSources = 3, kJudged = 13; ///< sweeps
  const sim::Trajectory weaving(sim::weaving_course(seconds{29}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  const RobotSetup robot = robot_of_restarts();
  Odometry odometry(robot.odometry(), robot.motion_sources());
  ResumeState now;
  std::deque<std::pair<ResumeState, std::vector<SurfacePoint>>> ended;
  std::list<Successor> successors;
  int sweeps = 0, judged = 0, right = 0;
  drive(sim::corridor(60, walls), weaving, robot, seconds{26}, [&](const Sweep& sweep) {
    const OdometryEstimate estimate = odometry.process(sweep);
    odometry.prepare_next();
    now = now.followed_by(estimate);
    if (++sweeps % 10 == 0)
      ended.emplace_back(now, legacy_of(odometry, now.T_odom_base).map_odom);
    if (!ended.empty() && sweep.end - ended.front().first.stamp >= gap) {
      successors.emplace_back(robot, ended.front().first, ended.front().second);
      ended.pop_front();
    }
    Sweep without_sources = sweep;
    without_sources.motion = {};
    successors.remove_if([&](Successor& next) {
      const OdometryEstimate its = next.odometry.process(++next.seen > kWithoutSources ? sweep : without_sources);
      next.odometry.prepare_next();
      if (next.seen < kJudged)
        return false;
      ++judged;
      EXPECT_TRUE(its.beginning == Beginning::map || its.beginning == Beginning::odometry);
      const double way_m = (estimate.T_odom_base.translation - next.T_odom_ended.translation).norm();
      const double off_m = (its.T_odom_base.translation - estimate.T_odom_base.translation).norm();
      right += off_m < 0.05 + 0.02 * way_m ? 1 : 0;
      return true;
    });
  });
  EXPECT_GE(judged, 18);
  return static_cast<double>(right) / judged;
}

/// Until the wheels are received the sweep fits the map at wrong poses, too, and two sweeps fit a robot at rest. One of
/// the starts in all still ends elsewhere (decision 30).
TEST(Relocation, WheelsReceivedAfterTheLidarBridgeACorridor) {
  for (const sim::Walls walls : {sim::Walls::pillars, sim::Walls::bare})
    for (const Duration gap : {milliseconds{800}, milliseconds{5800}})
      EXPECT_GT(share_at_the_true_pose(walls, gap), 0.9);
}

/// Returns the largest error one second after a restart. The robot drives 8 m and stands from 11 s on; its wheels spin
/// from 12 s on. The odometry ends before and during the spin, and another starts after `gap`.
double worst_beside_spinning_wheels_m(const sim::Scene& scene, Duration gap) {
  sim::Course course;
  course.stand(seconds{2}).change_speed(1.0, seconds{1}).straight(7.0).change_speed(0.0, seconds{1}).stand(seconds{9});
  const sim::Trajectory trajectory(course, sim::weaving_start(15, 0.0, 12.0), {},
                                   {.slips = {{seconds{12}, seconds{20}}}});
  RobotSetup robot = robot_of_restarts();
  robot.wheels->spinning_mps = 0.95;
  Odometry odometry(robot.odometry(), robot.motion_sources());
  ResumeState now;
  std::deque<std::pair<ResumeState, std::vector<SurfacePoint>>> ended;
  std::deque<std::pair<Odometry, int>> others; // with the number of sweeps processed by each
  int sweeps = 0, judged = 0;
  double worst_m = 0;
  drive(scene, trajectory, robot, seconds{20}, [&](const Sweep& sweep) {
    const OdometryEstimate estimate = odometry.process(sweep);
    odometry.prepare_next();
    now = now.followed_by(estimate);
    if (++sweeps >= 115 && sweeps <= 130 && sweeps % 5 == 0)
      ended.emplace_back(now, legacy_of(odometry, now.T_odom_base).map_odom);
    if (!ended.empty() && sweep.end - ended.front().first.stamp >= gap) {
      others.emplace_back(std::piecewise_construct, std::forward_as_tuple(robot.odometry(), robot.motion_sources()),
                          std::forward_as_tuple(0));
      others.back().first.begin_at(ended.front().first, ended.front().second);
      ended.pop_front();
    }
    for (auto& [other, seen] : others) {
      const Pose T_odom_base = other.process(sweep).T_odom_base;
      if (++seen != 11)
        continue;
      worst_m = std::max(worst_m, (T_odom_base.translation - estimate.T_odom_base.translation).norm());
      ++judged;
    }
  });
  EXPECT_EQ(judged, 4);
  return worst_m;
}

/// The wheels report 1 m/s. The first two sweeps show that the robot is at rest.
TEST(Relocation, SpinningWheelsDoNotMoveARobotAtRest) {
  for (const Duration gap : {milliseconds{500}, milliseconds{5000}}) {
    EXPECT_LT(worst_beside_spinning_wheels_m(sim::tunnel(60), gap), 0.05);
    EXPECT_LT(worst_beside_spinning_wheels_m(sim::corridor(60, sim::Walls::bare), gap), 0.05);
  }
}

TEST(Relocation, WithoutWheelsOneSecondIsBridgedAndSixRestart) {
  const sim::Trajectory weaving(sim::weaving_course(seconds{29}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  const sim::Scene tunnel = sim::tunnel(60);
  const Gaps second = drive_with_gaps(tunnel, weaving, seconds{1}, Wheels::none);
  EXPECT_GE(second.found, second.all - 1);
  EXPECT_EQ(second.elsewhere, 0);
  EXPECT_EQ(drive_with_gaps(tunnel, weaving, seconds{6}, Wheels::none).elsewhere, 0);
}

/// The driver restarts at an origin within the robot's reach.
TEST(Relocation, BareCorridorSigmaCoversTheErrorOfRestartedWheels) {
  const sim::Trajectory weaving(sim::weaving_course(seconds{15}, 1.0, 0.3, 12.0), sim::weaving_start(5, 0.3, 12.0));
  const RobotSetup robot = robot_of_restarts();
  Odometry odometry(robot.odometry(), robot.motion_sources());
  std::optional<Odometry> next;
  ResumeState last;
  double worst_sigma = 0;
  int begun = 0;
  drive(sim::corridor(60, sim::Walls::bare), weaving, robot, seconds{12}, [&](const Sweep& sweep) {
    const OdometryEstimate truth = odometry.process(sweep);
    odometry.prepare_next();
    if (to_seconds(sweep.end - weaving.start()) < 8) {
      last = last.followed_by(truth);
    } else {
      if (!next) {
        last.T_source_base[0] = Pose{Eigen::Quaterniond::Identity(), {2.5, 0, 0}} * *last.T_source_base[0];
        last.stamp -= seconds{3}; // a robot can move farther in that time
        next.emplace(robot.odometry(), robot.motion_sources());
        next->begin_at(last, legacy_of(odometry, last.T_odom_base).map_odom);
      }
      const OdometryEstimate estimate = next->process(sweep);
      begun += estimate.beginning ? 1 : 0;
      const Vector6 error = difference(estimate.T_odom_base, truth.T_odom_base);
      worst_sigma = std::max(worst_sigma, std::abs(error.x()) / std::sqrt(estimate.pose_covariance(0, 0)));
    }
  });
  EXPECT_GT(begun, 30);
  EXPECT_LT(worst_sigma, 3);
}

} // namespace
} // namespace locus::test
