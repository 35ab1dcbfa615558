// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>

#include "locus_sim/capture_writer.hpp"
#include "support/scenes.hpp"

namespace locus::test {

/// Writes a drive around a room by a robot with ordinary sensor errors (noise, bias, slip).
inline void write_room_drive(const std::filesystem::path& folder, Duration duration, int lidars = 1,
                             double speed_mps = 1.0) {
  sim::RobotOptions robot{.lidars = {}};
  for (int i = 0; i < lidars; ++i) {
    sim::NamedLidar lidar{i == 0 ? "front" : "rear", {}};
    lidar.options.T_base_lidar.translation = {0.3 - 0.6 * i, 0, 0.75};
    lidar.options.port = static_cast<std::uint16_t>(2368 + i);
    lidar.options.source_ip += static_cast<std::uint32_t>(i);
    lidar.options.first_azimuth_deg = 117 * i;
    lidar.options.range_noise_m = 0.01;
    lidar.options.sends_position_packets = true;
    robot.lidars.push_back(lidar);
  }
  robot.imu->faults = {
      .gyro_bias_radps = {0.001, -0.0015, 0.002}, .gyro_noise_radps = 0.003, .accelerometer_noise_mps2 = 0.05};
  robot.odometry.front().faults = {.scale_error = 0.01, .noise_m_per_sqrt_m = 0.005};
  const sim::Trajectory trajectory(sim::room_course(duration, speed_mps), sim::room_start());
  sim::write_capture_folder(folder, sim::room(), trajectory, duration, robot);
}

/// Drives written at build time (CMakeLists.txt), read-only: 8 s and 20 s around the room, 20 s each of locus-sim's
/// husky through plant and mine and of its walking robot through the plant, and 4 s around the room in KITTI's format.
std::filesystem::path room_drive();
std::filesystem::path long_room_drive();
std::filesystem::path plant_drive();
std::filesystem::path mine_drive();
std::filesystem::path walking_drive();
std::filesystem::path kitti_room_drive();

} // namespace locus::test
