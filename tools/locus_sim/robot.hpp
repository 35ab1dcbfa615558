// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "locus_sim/capture_writer.hpp"
#include "locus_sim/driver.hpp"
#include "locus_sim/imperfections.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {

/// What the user may choose about the sensors.
struct SensorChoice {
  int lidars = 1; ///< 1..3
  LidarModel model = velodyne::Model::vlp16;
  velodyne::ReturnMode return_mode = velodyne::ReturnMode::strongest;
  bool noise = true; ///< false: every sensor is perfect
  double dust = 0;   ///< share of the pulses that meet dust
  Imperfections imperfections = {};
};

/// A robot, how it moves and what it carries.
struct Robot {
  Agility agility;
  Ride ride; ///< without ground, slips and flicks
  RobotOptions sensors;
  double reach_m = 0.35; ///< from its middle to its side: what people keep clear of
};

/// Skid-steered, as the Husky of the LOCUS paper: vibration, sudden acceleration; wheel-inertial odometry, IMU.
Robot make_husky(const SensorChoice& choice, std::uint64_t seed);

/// Legged, as its Spot: a gait of 2 Hz; visual-inertial and kinematic-inertial odometry, IMU.
Robot make_spot(const SensorChoice& choice, std::uint64_t seed);

/// A lidar and an IMU that someone carries who walks, looks round and turns on his heel: nothing that counts steps.
Robot make_handheld(const SensorChoice& choice, std::uint64_t seed);

/// A car, 15 m/s where the road allows: lidars on its roof; wheel-inertial odometry, IMU.
Robot make_car(const SensorChoice& choice, std::uint64_t seed);

/// A robot by its name on the command line. The seed decides how large each fault of its sensors is.
struct NamedRobot {
  std::string_view name;
  Robot (*make)(const SensorChoice& choice, std::uint64_t seed);
};
inline constexpr std::array kRobots{NamedRobot{"husky", make_husky}, NamedRobot{"spot", make_spot},
                                    NamedRobot{"handheld", make_handheld}, NamedRobot{"car", make_car}};

/// How the robot goes about a world for `duration`, with wheels or feet that slip at times. The seed decides the
/// course.
Trajectory drive_about(const World& world, const Robot& robot, Duration duration, const std::vector<Slip>& slips,
                       std::uint64_t seed);

} // namespace locus::sim
