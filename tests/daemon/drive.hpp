// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <vector>

#include "config/config.hpp"
#include "daemon/input.hpp"
#include "daemon/sweep_processor.hpp"
#include "drivers/lidar_router.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::daemon {

/// Inputs of a robot's computer during eight seconds around the room, in the order of arrival: a VLP-16 at 10 Hz, wheel
/// odometry and an IMU.
class Drive {
 public:
  static constexpr std::size_t kSweeps = 80;

  /// Configuration of the robot.
  static Config config();

  /// Created once for all tests.
  static const Drive& instance();

  [[nodiscard]] const std::vector<Input>& inputs() const { return inputs_; }

 private:
  Drive();

  std::deque<std::array<std::byte, velodyne::kDataPacketBytes>> payloads_;
  std::vector<Input> inputs_;
};

/// Returns the inputs of the drive without pacing.
class DriveInput : public InputSource {
 public:
  Input next(Duration timeout) override;

 private:
  std::size_t given_ = 0;
};

/// Processes the drive in one thread, as a reference for the live threads. `took` is the registration alone.
std::vector<ProcessedSweep> process_in_one_thread(const Config& config);

LidarRouter open_lidars(const Config& config);

} // namespace locus::daemon
