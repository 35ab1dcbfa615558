// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <string>

#include "recording.hpp"
#include "robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::seconds;

constexpr Duration kDrive = seconds{8};

/// Every return of a drive with turns at 2 rad/s, corrected with the true motion, from the end of its sweep.
double farthest_from_its_surface_m(const sim::Scene& scene, const sim::Trajectory& trajectory,
                                   bool motion_correction = true) {
  RobotSetup setup;
  setup.sweep = every_return();
  setup.sweep.motion_correction = motion_correction;
  setup.wheels = sim::OdometryFaults{};
  setup.imu = sim::ImuFaults{};
  double farthest_m = 0.0;
  std::size_t points = 0;
  drive(scene, trajectory, setup, kDrive, [&](const Sweep& sweep) {
    if (sweep.sequence < 2)
      return; // the wheels had not said two things yet
    const Pose T_world_base = trajectory.T_world_base(sweep.end);
    for (std::size_t i = 0; i < sweep.points.size(); i += 7) { // a sample is enough
      const Eigen::Vector3d p_world = T_world_base * sweep.points[i].position_base_m.cast<double>().eval();
      farthest_m = std::max(farthest_m, scene.distance_to_surface(p_world));
      ++points;
    }
  });
  EXPECT_GT(points, 100'000U);
  return farthest_m;
}

sim::Trajectory there_and_back(const sim::Start& start) {
  return sim::Trajectory(
      sim::Course{}.change_speed(2.0, seconds{1}).straight(3).change_speed(0.0, seconds{1}).turn(std::numbers::pi, 2.0),
      start, {.height_m = 0.02, .tilt_rad = 0.02, .wavelength_m = 4});
}

TEST(MotionCorrection, BringsEveryPointOfARoomToItsSurface) {
  const sim::Trajectory laps(sim::room_course(kDrive, 1.0), sim::room_start());
  EXPECT_LT(farthest_from_its_surface_m(sim::room(), laps), 0.02);
}

TEST(MotionCorrection, BringsEveryPointOfACorridorToItsSurface) {
  EXPECT_LT(farthest_from_its_surface_m(sim::corridor(20), there_and_back({.position_m = {5, 0}})), 0.02);
}

TEST(MotionCorrection, BringsEveryPointOfATunnelToItsSurface) {
  EXPECT_LT(farthest_from_its_surface_m(sim::tunnel(20), there_and_back({.position_m = {5, 0}})), 0.02);
}

TEST(MotionCorrection, WithoutItPointsLieFarOff) {
  const sim::Trajectory laps(sim::room_course(kDrive, 1.0), sim::room_start());
  EXPECT_GT(farthest_from_its_surface_m(sim::room(), laps, false), 0.2) << "else the tests above prove nothing";
}

} // namespace
} // namespace locus::test
