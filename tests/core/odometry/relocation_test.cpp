// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocation.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/robot.hpp"
#include "locus_sim/driver.hpp"
#include "locus_sim/world.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

/// What one odometry leaves to the next.
struct Legacy {
  Pose T_odom_base;
  std::vector<SurfacePoint> map_odom;
};

Legacy legacy_of(const Odometry& odometry, const Pose& T_odom_base) {
  Legacy legacy{T_odom_base, {}};
  read_planes(odometry.map().fine(), legacy.map_odom);
  return legacy;
}

/// A robot whose odometry ends every three seconds, and begins anew with the next sweep.
class Restarts {
 public:
  Restarts(const sim::Scene& scene, const sim::Trajectory& trajectory, Duration duration) {
    RobotSetup robot;
    robot.lidars.front().range_noise_m = 0.02;
    robot.wheels = sim::OdometryFaults{.scale_error = 0.005};
    robot.imu = sim::ImuFaults{.gyro_noise_radps = 0.002};
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
    odometry.begin_at(T_odom_expected, legacy.map_odom);
    const OdometryEstimate estimate = odometry.process(sweep);
    return odometry.resumed() ? std::optional{estimate.T_odom_base} : std::nullopt;
  }

  OdometryOptions options_;
  std::vector<MotionSourceOptions> sources_;
  std::vector<Legacy> legacies_;
};

/// Half of what the lidar sees there is far, hidden a moment ago, or moves.
TEST(Relocation, InAPlantTheRobotIsFoundWhereItIsAndNowhereElse) {
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

TEST(Relocation, InATunnelTheRobotIsFoundWhereItIsAndNowhereElse) {
  const sim::Course course = sim::weaving_course(seconds{34}, 1.0, 0.3, 12.0);
  const Restarts restarts(sim::tunnel(60), sim::Trajectory(course, sim::weaving_start(5, 0.3, 12.0)), seconds{31});
  ASSERT_EQ(restarts.all(), 10U);
  EXPECT_EQ(restarts.found, 10);
  EXPECT_EQ(restarts.found_ahead, 0);
  EXPECT_EQ(restarts.found_aside, 0);
  EXPECT_EQ(restarts.found_where_it_was_long_ago, 0);
}

/// Nothing tells there how far along it is, so only what is beside it can be refused.
TEST(Relocation, InABareCorridorTheRobotIsFoundWhereItIsAndNotBesideIt) {
  const sim::Course course = sim::weaving_course(seconds{34}, 1.0, 0.3, 12.0);
  const Restarts restarts(sim::corridor(60, sim::Walls::bare),
                          sim::Trajectory(course, sim::weaving_start(5, 0.3, 12.0)), seconds{31});
  ASSERT_EQ(restarts.all(), 10U);
  EXPECT_EQ(restarts.found, 10);
  EXPECT_EQ(restarts.found_aside, 0);
}

} // namespace
} // namespace locus::test
