// SPDX-License-Identifier: Apache-2.0
// A robot that stands, and what moves around it.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "core/odometry/odometry.hpp"
#include "core/robot.hpp"
#include "locus_sim/figures.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kLength_m = 40.0;
const sim::Start kMiddle{.position_m = {0.5 * kLength_m, 0.0}, .heading_rad = 0.0};

/// Returns a corridor in which nothing but two people, who walk past the robot at 1.3 m/s, shows the position along it.
sim::Scene corridor_with_walkers(double phase) {
  constexpr double kWay_m = 6.0, kSpeed_mps = 1.3;
  std::vector<sim::Mover> walkers;
  for (const auto& [y_m, of_walker] : {std::pair{0.9, phase}, {-0.9, phase + 0.1}})
    walkers.push_back({.parts = sim::standing_person(),
                       .from_m = {0.5 * (kLength_m - kWay_m), y_m, 0.0},
                       .to_m = {0.5 * (kLength_m + kWay_m), y_m, 0.0},
                       .period_s = 2.0 * kWay_m / kSpeed_mps,
                       .phase = of_walker});
  return sim::Scene(sim::corridor(kLength_m, sim::Walls::bare).surfaces(), std::move(walkers));
}

/// A VLP-16 and an IMU.
RobotSetup robot() {
  RobotSetup setup;
  setup.lidars.front().range_noise_m = 0.02;
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return setup;
}

/// Returns the largest distance from the first estimate.
double farthest_m(const sim::Scene& scene, const sim::Trajectory& trajectory, const RobotSetup& setup,
                  Duration duration) {
  Odometry odometry(setup.odometry(), setup.motion_sources());
  std::optional<Eigen::Vector3d> first;
  double farthest = 0.0;
  drive(scene, trajectory, setup, duration, [&](const Sweep& sweep) {
    const Eigen::Vector3d position = odometry.process(sweep).T_odom_base.translation;
    farthest = std::max(farthest, (position - first.value_or(position)).norm());
    first = first.value_or(position);
  });
  return farthest;
}

TEST(OdometryAtRest, PeopleWhoWalkPastDoNotMoveIt) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{4}), kMiddle);
  for (const double phase : {0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8})
    EXPECT_LT(farthest_m(corridor_with_walkers(phase), trajectory, robot(), seconds{4}), 0.01) << phase;
}

TEST(OdometryAtRest, ARobotThatMovesOffBesideThemIsFollowed) {
  sim::Course course;
  course.stand(seconds{2}).change_speed(1.0, seconds{1}).straight(2.0);
  const sim::Trajectory trajectory(course, kMiddle);
  for (const double phase : {0.0, 0.3, 0.6})
    EXPECT_NEAR(farthest_m(corridor_with_walkers(phase), trajectory, robot(), milliseconds{4500}), 2.0, 0.1) << phase;
}

} // namespace
} // namespace locus::test
