// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/world.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "core/sources/motion_sample.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "locus_sim/driver.hpp"
#include "locus_sim/robot.hpp"
#include "support/returns.hpp"

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A robot on a course through a world, as locus-sim makes them.
struct Drive {
  World world;
  Robot robot;
  Trajectory trajectory;

  static Drive through(const NamedWorld& named, const NamedRobot& named_robot, Duration duration, std::uint64_t seed) {
    World world = named.make(seed);
    Robot robot = named_robot.make({.noise = false}, seed);
    robot.ride.ground_m = world.ground_m;
    Dice dice(seed);
    const PlannedCourse planned = plan_course(world.roads, robot.agility, duration, dice);
    Trajectory trajectory(planned.course, planned.start, world.terrain, robot.ride);
    return {std::move(world), std::move(robot), std::move(trajectory)};
  }
};

class EveryWorld : public testing::TestWithParam<NamedWorld> {};

INSTANTIATE_TEST_SUITE_P(Of, EveryWorld, testing::ValuesIn(kWorlds),
                         [](const auto& test) { return std::string(test.param.name); });

/// The whole chain of locus-sim and our drivers: bytes to points to where the lidar was at the time of each firing, on
/// a legged robot, among things that move. What is left is half a step of range and the hundredths of a degree of
/// azimuth.
TEST_P(EveryWorld, WithoutNoiseEveryReturnLiesOnASurface) {
  const Drive drive = Drive::through(GetParam(), kRobots[1], seconds{30}, 3);
  SyntheticLidarOptions options = drive.robot.sensors.lidars.front().options;
  options.sends_position_packets = false;
  SyntheticLidar lidar(drive.world.scene, drive.trajectory, options);
  velodyne::Decoder decoder({.model = std::get<velodyne::Model>(options.model)});
  const auto packet = std::make_unique<LidarPacket>();
  const double half_step_m =
      velodyne::spec(std::get<velodyne::Model>(options.model)).calibration.distance_resolution_m / 2;
  std::size_t returns = 0;
  for (Datagram datagram = lidar.next(); datagram.receive_stamp < drive.trajectory.start() + seconds{6};
       datagram = lidar.next()) {
    ASSERT_FALSE(decoder.decode(datagram.payload, *packet));
    const Stamp sent = datagram.receive_stamp -
                       velodyne::packet_duration(std::get<velodyne::Model>(options.model), options.return_mode);
    const std::vector<LidarReturn> echoes = test::returns_of(*packet);
    for (std::size_t i = returns % 29; i < echoes.size();
         i += 29, ++returns) { // not all: it takes time to look them up
      const LidarReturn& echo = echoes[i];
      const Stamp fired = sent + Duration{echo.offset_ns};
      const Pose T_world_lidar = drive.trajectory.T_world_base(fired) * options.T_base_lidar;
      const Eigen::Vector3d point = T_world_lidar * Eigen::Vector3f{echo.x_m, echo.y_m, echo.z_m}.cast<double>();
      const double aside_m = 0.01 * kRadPerDeg * static_cast<double>(echo.range_m);
      ASSERT_LT(drive.world.scene.distance_to_surface(point, fired), half_step_m + aside_m + 1e-5);
    }
  }
  EXPECT_GT(returns, 10'000U);
}

TEST_P(EveryWorld, RobotKeepsClearOfWhatStandsAround) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const Drive drive = Drive::through(GetParam(), kRobots[0], seconds{900}, seed);
    for (Stamp t = drive.trajectory.start(); t < drive.trajectory.end(); t += milliseconds{700}) {
      const Eigen::Vector3d middle = drive.trajectory.T_world_base(t).translation + Eigen::Vector3d{0, 0, 0.5};
      ASSERT_GT(drive.world.scene.distance_to_surface(middle, t), 0.35) << middle.transpose() << " seed " << seed;
    }
  }
}

TEST_P(EveryWorld, CourseOfAnHourStartsAndEndsAtRestAndIsOneThatARobotCanDrive) {
  const Drive drive = Drive::through(GetParam(), kRobots[0], std::chrono::hours{1}, 5);
  const Agility& agility = drive.robot.agility;
  const Trajectory& trajectory = drive.trajectory;
  EXPECT_EQ(trajectory.end() - trajectory.start(), std::chrono::hours{1});
  EXPECT_GT(trajectory.length_m(), 900); // of 3600 m at full speed without a stop
  EXPECT_LT(trajectory.at(trajectory.start() + seconds{1}).velocity_world_mps.norm(), 1e-9);
  EXPECT_LT(trajectory.at(trajectory.end() - seconds{1}).velocity_world_mps.norm(), 1e-9);
  // The largest acceleration of an eased change of speed is 1.875 times its mean; corners and the ground add to it.
  const double limit_mps2 = 1.875 * agility.sudden_mps2 + agility.cruise_mps * agility.turn_rate_radps + 6;
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{190}) {
    const BaseMotion motion = trajectory.at(t);
    ASSERT_LT(motion.velocity_world_mps.head<2>().norm(), agility.cruise_mps + 0.05);
    ASSERT_LT(motion.acceleration_world_mps2.norm(), limit_mps2);
  }
}

TEST(Course, OfAnotherSeedGoesElsewhere) {
  const Drive one = Drive::through(kWorlds[0], kRobots[0], seconds{120}, 1);
  const Drive other = Drive::through(kWorlds[0], kRobots[0], seconds{120}, 2);
  const Eigen::Vector3d a = one.trajectory.T_world_base(one.trajectory.end()).translation;
  EXPECT_GT((a - other.trajectory.T_world_base(other.trajectory.end()).translation).norm(), 1);
}

TEST(Imu, GyroIntegratesToTheTruthOnALeggedRobot) {
  const Drive drive = Drive::through(kWorlds[0], kRobots[1], seconds{30}, 4);
  SyntheticImu imu(drive.trajectory, 2000);
  ImuSample last = imu.next();
  Eigen::Quaterniond R = *last.attitude;
  while (last.stamp < drive.trajectory.end()) {
    const ImuSample next = imu.next();
    const Eigen::Vector3d mean_radps = (last.angular_velocity_radps + next.angular_velocity_radps) / 2;
    R = (R * so3_exp(to_seconds(next.stamp - last.stamp) * mean_radps)).normalized();
    last = next;
  }
  EXPECT_LT(angle_rad(R.conjugate() * *last.attitude), 1e-4);
}

/// Twice integrated, away from the origin of the base: position again, over ten seconds of driving.
TEST(Imu, AccelerometerIntegratesToTheTruthWhereItIsMounted) {
  const Drive drive = Drive::through(kWorlds[0], kRobots[0], seconds{30}, 4);
  const Pose T_base_imu{from_rpy_rad({0.1, -0.2, 2.0}), {0.2, -0.3, 0.4}};
  SyntheticImu imu(drive.trajectory, 4000, {}, 1, T_base_imu);
  const auto T_world_imu = [&](Stamp t) { return drive.trajectory.T_world_base(t) * T_base_imu; };
  Eigen::Vector3d position = T_world_imu(drive.trajectory.start()).translation, velocity = Eigen::Vector3d::Zero();
  for (ImuSample now = imu.next(), next = imu.next(); next.stamp < drive.trajectory.start() + seconds{12};
       now = next, next = imu.next()) {
    const double step_s = to_seconds(next.stamp - now.stamp);
    const Eigen::Vector3d mean_mps2 =
        (*now.attitude * now.specific_force_mps2 + *next.attitude * next.specific_force_mps2) / 2 -
        Eigen::Vector3d{0, 0, kGravity_mps2};
    position += step_s * velocity + step_s * step_s / 2 * mean_mps2;
    velocity += step_s * mean_mps2;
  }
  EXPECT_GT(drive.trajectory.at(drive.trajectory.start() + seconds{6}).velocity_world_mps.norm(), 0.1);
  EXPECT_LT((position - T_world_imu(drive.trajectory.start() + seconds{12}).translation).norm(), 2e-3);
}

TEST(Wheels, ErrorIsAPercentOrTwoOfTheWay) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Drive drive = Drive::through(kWorlds[0], kRobots[0], seconds{300}, seed);
    const OdometryFaults faults = make_husky({}, seed).sensors.odometry.front().faults;
    SyntheticOdometry wheels(drive.trajectory, 50, faults, seed);
    const Pose T_source_world = drive.trajectory.T_world_base(drive.trajectory.start()).inverse();
    OdometrySample last = wheels.next();
    while (last.stamp < drive.trajectory.end())
      last = wheels.next();
    const Pose T_source_base = T_source_world * drive.trajectory.T_world_base(last.stamp);
    const double error_m = (last.T_source_base.translation - T_source_base.translation).norm();
    EXPECT_GT(error_m, 0.002 * drive.trajectory.length_m());
    EXPECT_LT(error_m, 0.15 * drive.trajectory.length_m());
  }
}

TEST(Wheels, SpinWhileTheRobotStandsInASlip) {
  const Trajectory trajectory(Course{}.change_speed(1, seconds{1}).straight(20), {}, {},
                              {.slips = {{seconds{5}, seconds{9}}}});
  SyntheticOdometry wheels(trajectory, 50, {.spinning_mps = 1});
  const Stamp from = trajectory.start() + milliseconds{5400}, to = trajectory.start() + milliseconds{8600};
  OdometrySample sample = wheels.next();
  while (sample.stamp < from)
    sample = wheels.next();
  const double before_m = sample.T_source_base.translation.x();
  while (sample.stamp < to)
    sample = wheels.next();
  EXPECT_EQ(trajectory.T_world_base(from).translation, trajectory.T_world_base(to).translation);
  EXPECT_NEAR(sample.T_source_base.translation.x() - before_m, 3.2, 1e-6);
  EXPECT_EQ(trajectory.slip_ratio(from), 1);
  EXPECT_EQ(trajectory.slip_ratio(trajectory.start() + seconds{4}), 0);
}

} // namespace
} // namespace locus::sim
