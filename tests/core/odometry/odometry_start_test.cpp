// SPDX-License-Identifier: Apache-2.0
// Starts of the odometry in mid-drive, and of a robot whose wheels say more than it does.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

/// A VLP-16, wheels and an IMU.
RobotSetup robot_on_wheels() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  setup.wheels = sim::OdometryFaults{.scale_error = 0.005, .noise_m_per_sqrt_m = 0.005};
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return setup;
}

struct Way {
  double driven_m, error_m, sigma_m; ///< error and its standard deviation along the way
};

/// Starts the odometry `at` after the start of a drive, and returns where it is at the end of it.
Way start_at(Duration at, const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
             Duration end) {
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::optional<OdometryEstimate> first, last;
  drive(scene, trajectory, setup, end, [&](const Sweep& sweep) {
    if (sweep.start < trajectory.start() + at)
      return;
    last = odometry.process(sweep);
    first = first.value_or(*last);
  });
  const Pose truth = true_motion(trajectory, first->stamp, last->stamp);
  const Eigen::Vector3d moved_m = (first->T_odom_base.inverse() * last->T_odom_base).translation;
  return {truth.translation.norm(), (moved_m - truth.translation).norm(), std::sqrt(last->pose_covariance(0, 0))};
}

/// Two sweeps in a bare corridor fit a robot at rest about as well as one in motion: the wheels decide.
TEST(OdometryStart, WheelsSayThatARobotIsInMotionInABareCorridor) {
  for (const double speed_mps : {0.3, 1.0, 2.0}) {
    sim::Course course;
    course.change_speed(speed_mps, seconds{1}).straight(9.0 * speed_mps);
    const sim::Trajectory trajectory(course, {.position_m = {50, 0}});
    const Way way =
        start_at(seconds{3}, sim::corridor(200, sim::Walls::bare), trajectory, robot_on_wheels(), seconds{6});
    ASSERT_GT(way.driven_m, 2.5 * speed_mps);
    EXPECT_LT(way.error_m, 0.02 + 0.01 * way.driven_m) << speed_mps << " m/s";
    EXPECT_LT(way.error_m, 4.0 * way.sigma_m) << speed_mps << " m/s";
  }
}

TEST(OdometryStart, WheelsThatSpinDoNotMoveARobotAtRest) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{4}), sim::plant_start());
  std::vector<Sweep> sweeps = sweeps_of(sim::plant(), trajectory, robot_on_wheels(), seconds{3});
  Odometry odometry(robot_on_wheels().odometry(), robot_on_wheels().motion_sources());
  for (Sweep& sweep : sweeps) {
    const double spun_m = 1.0 * to_seconds(sweep.end - sweeps.front().start);
    sweep.motion.sources[0].T_source_base.translation.x() += spun_m;
    EXPECT_LT(odometry.process(sweep).T_odom_base.translation.norm(), 0.02);
  }
}

} // namespace
} // namespace locus::test
