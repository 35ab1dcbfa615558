// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "locus_sim/scene.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

struct NamedLidar {
  std::string name = "front";
  SyntheticLidarOptions options;
};

/// What a robot carries, for a capture folder.
struct RobotOptions {
  std::vector<NamedLidar> lidars{{}};
  std::optional<ImuFaults> imu = ImuFaults{};                ///< 200 Hz, nothing: no IMU
  std::optional<OdometryFaults> odometry = OdometryFaults{}; ///< wheels, 50 Hz, nothing: none
  std::uint64_t seed = 1;                                    ///< of IMU and odometry; lidars have their own
};

/// Drives a robot through a scene for `duration` and writes what its sensors saw as a capture folder: lidar.pcap,
/// imu.csv, wio.tum, the true poses as gt.tum (100 Hz) and a config.yaml that names the sensors and overrides nothing
/// else. Makes the folder. Throws std::runtime_error when it cannot write.
void write_capture_folder(const std::filesystem::path& folder, const Scene& scene, const Trajectory& trajectory,
                          Duration duration, const RobotOptions& robot);

} // namespace locus::sim
