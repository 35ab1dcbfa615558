// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>

#include "locus_sim/capture_writer.hpp"
#include "replay_run.hpp"
#include "support/scenes.hpp"

namespace locus::test {

/// What a robot with ordinary sensors (noise, bias, slip) brings back from a drive around a room.
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

/// Eight seconds of it, written once for all tests of a process.
inline const std::filesystem::path& room_drive() {
  static const TemporaryFolder folder;
  static const bool written = (write_room_drive(folder.path(), std::chrono::seconds{8}), true);
  static_cast<void>(written);
  return folder.path();
}

} // namespace locus::test
