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

/// User's choice of sensors.
struct SensorChoice {
  int lidars = 1; ///< 1..3
  LidarModel model = velodyne::Model::vlp16;
  velodyne::ReturnMode return_mode = velodyne::ReturnMode::strongest;
  bool noise = true; ///< false: every sensor is perfect
  double dust = 0;   ///< share of pulses that hit dust
  Imperfections imperfections = {};
};

/// Robot with its dynamics and sensors.
struct Robot {
  Agility agility;
  Ride ride; ///< without ground, slips and flicks
  RobotOptions sensors;
  double reach_m = 0.35; ///< from its centre to its side: people stay clear of it
};

/// Returns a skid-steered robot, like the Husky of the LOCUS paper: vibration, sudden acceleration; wheel-inertial
/// odometry, IMU.
Robot make_husky(const SensorChoice& choice, std::uint64_t seed);

/// Returns a legged robot, like the paper's Spot: a gait of 2 Hz; visual-inertial and kinematic-inertial odometry, IMU.
Robot make_spot(const SensorChoice& choice, std::uint64_t seed);

/// Returns a lidar and an IMU carried by a person who walks, looks around and turns on their heel; no odometry.
Robot make_handheld(const SensorChoice& choice, std::uint64_t seed);

/// Returns a car, 15 m/s where the road allows: lidars on its roof; wheel-inertial odometry, IMU.
Robot make_car(const SensorChoice& choice, std::uint64_t seed);

/// Robot with its name on the command line. The seed determines the size of each sensor fault.
struct NamedRobot {
  std::string_view name;
  Robot (*make)(const SensorChoice& choice, std::uint64_t seed);
};
inline constexpr std::array kRobots{NamedRobot{"husky", make_husky}, NamedRobot{"spot", make_spot},
                                    NamedRobot{"handheld", make_handheld}, NamedRobot{"car", make_car}};

/// Drives the robot about a world for `duration`, with slips of wheels or feet. The seed determines the course.
Trajectory drive_about(const World& world, const Robot& robot, Duration duration, const std::vector<Slip>& slips,
                       std::uint64_t seed);

} // namespace locus::sim
