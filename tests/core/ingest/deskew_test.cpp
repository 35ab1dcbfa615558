// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <string>
#include <vector>

#include "core/ingest/deskew.hpp"
#include "core/recording.hpp"
#include "core/robot.hpp"
#include "support/scenes.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kDrive = seconds{8};

/// Returns the largest distance of a return from its surface: a drive with turns at 2 rad/s, de-skewed to the sweep's
/// end with the true motion.
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
      return; // the wheels have not delivered two samples yet
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

/// Sweeps of a robot at rest whose gyro starts to report a false rate in the middle of one.
TEST(MotionCorrection, OfAWrongGyroIsUndone) {
  const sim::Trajectory trajectory(sim::Course{}.stand(seconds{2}), sim::room_start());
  RobotSetup setup;
  setup.imu = sim::ImuFaults{.gyro_noise_radps = 1e-4};
  const std::vector<Sweep> good = sweeps_of(sim::room(), trajectory, setup, seconds{2});
  const Stamp wrong_from = good[10].start + (good[10].end - good[10].start) / 3;
  setup.gyro_error_radps = [=](Stamp stamp) { return stamp >= wrong_from ? 2.0 : 0.0; };
  const std::vector<Sweep> bent = sweeps_of(sim::room(), trajectory, setup, seconds{2});
  std::vector<SurfacePoint> mended;
  for (std::size_t i = 9; i < 13; ++i) {
    ASSERT_EQ(bent[i].points.size(), good[i].points.size());
    SweepCorrection::constant(bent[i], Vector6::Zero()).apply(bent[i].points, mended);
    float bent_by_m = 0.0F, left_m = 0.0F, left_rad = 0.0F;
    for (std::size_t k = 0; k < mended.size(); ++k) {
      const SweepPoint& truth = good[i].points[k];
      bent_by_m = std::max(bent_by_m, (bent[i].points[k].position_base_m - truth.position_base_m).norm());
      left_m = std::max(left_m, (mended[k].position_m - truth.position_base_m).norm());
      if (!mended[k].normal.isZero() && !truth.normal_base.isZero())
        left_rad = std::max(left_rad, (mended[k].normal - truth.normal_base).norm());
    }
    EXPECT_EQ(bent_by_m > 0.2F, i >= 10) << "sweep " << i;
    EXPECT_LT(left_m, 0.02F) << "sweep " << i;
    EXPECT_LT(left_rad, 0.05F) << "sweep " << i;
  }
}

/// A lidar that sees a quarter of the turn, on a robot that turns only while it looks.
TEST(MotionCorrection, MeanTwistIsThatOfTheWholeSweepIfPointsComeFromItsEnd) {
  constexpr double kTurn_rad = 0.05;
  Sweep sweep;
  sweep.start = Stamp{seconds{5}};
  sweep.end = sweep.start + milliseconds{100};
  const auto turned = [](double yaw_rad) { return Pose{so3_exp({0, 0, yaw_rad}), Eigen::Vector3d::Zero()}; };
  sweep.path.places[sweep.path.count++] = {sweep.start + milliseconds{75}, turned(0.0)};
  sweep.path.places[sweep.path.count++] = {sweep.end, turned(kTurn_rad)};
  sweep.points = {{{10, 0, 0}, Eigen::Vector3f::UnitX(), 0.025F, 0, 0},
                  {{0, 10, 0}, Eigen::Vector3f::UnitY(), 0, 0, 0}};
  const Vector6 mean = corrected_twist(sweep);
  EXPECT_NEAR(mean[5], kTurn_rad / 0.1, 1e-9);
  EXPECT_LT(mean.head<5>().norm(), 1e-9);
  std::vector<SurfacePoint> scan;
  SweepCorrection::all(sweep, mean).apply(sweep.points, scan);
  for (std::size_t i = 0; i < scan.size(); ++i)
    EXPECT_LT((scan[i].position_m - sweep.points[i].position_base_m).norm(), 1e-4F) << "no motion is left to correct";
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

TEST(MotionCorrection, WithoutItPointsAreFarFromTheirSurface) {
  const sim::Trajectory laps(sim::room_course(kDrive, 1.0), sim::room_start());
  EXPECT_GT(farthest_from_its_surface_m(sim::room(), laps, false), 0.2) << "else the tests above prove nothing";
}

} // namespace
} // namespace locus::test
