// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cmath>
#include <filesystem>
#include <numbers>

#include <Eigen/Core>

#include "core/base/stamp.hpp"

/// A simulated drive of a car with a 64-ring lidar around a room, in the format of KITTI's raw data.
namespace locus::test::kitti_room {

inline constexpr int kSweeps = 40, kRings = 64, kColumns = 720;
inline constexpr Duration kPeriod = std::chrono::milliseconds{100};

/// Unit vector of a ray in the lidar's frame; `clockwise_rad` is 0 in front.
inline Eigen::Vector3d direction(int ring_from_top, double clockwise_rad) {
  const double elevation_rad = (2.0 - 26.8 * ring_from_top / (kRings - 1)) * std::numbers::pi / 180.0;
  return {std::cos(elevation_rad) * std::cos(clockwise_rad), -std::cos(elevation_rad) * std::sin(clockwise_rad),
          std::sin(elevation_rad)};
}

/// Writes the folder of the day with its calibration, and the drive in it.
void write_drive(const std::filesystem::path& day);

} // namespace locus::test::kitti_room
