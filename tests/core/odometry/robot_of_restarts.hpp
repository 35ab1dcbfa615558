// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/robot.hpp"

namespace locus::test {

/// Lidar, wheels and a gyro with the errors of ordinary ones.
inline RobotSetup robot_of_restarts() {
  RobotSetup robot;
  robot.lidars.front().range_noise_m = 0.02;
  robot.wheels = sim::OdometryFaults{.scale_error = 0.005};
  robot.imu = sim::ImuFaults{.gyro_noise_radps = 0.002, .accelerometer_noise_mps2 = 0.02};
  return robot;
}

} // namespace locus::test
