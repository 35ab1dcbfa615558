// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "locus_sim/capture_sink.hpp"
#include "locus_sim/observed_space.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

struct NamedLidar {
  std::string name = "front";
  SyntheticLidarOptions options;
  std::optional<Pose> T_base_configured{}; ///< extrinsics in config.yaml; nothing: the true ones
  std::optional<ImuFaults> imu{};          ///< of an Ouster's own unit
};

struct MountedImu {
  ImuFaults faults;
  Pose T_base_imu;
  std::optional<Pose> T_base_configured{}; ///< as for a lidar
};

struct NamedOdometry {
  std::string name = "wio";
  std::string topic = "/wheel_odometry";
  double rate_hz = 50;
  OdometryFaults faults;
};

/// Sensors and limits of a robot, for a capture folder.
struct RobotOptions {
  std::vector<NamedLidar> lidars{{}};
  std::optional<MountedImu> imu = MountedImu{}; ///< 200 Hz, nothing: no IMU
  std::vector<NamedOdometry> odometry{{}};      ///< the best first
  std::uint64_t seed = 1;                       ///< for IMU and odometry; lidars have their own
  std::optional<Bounds> body_box{};             ///< base frame; robot body, for config.yaml
  std::optional<double> max_speed_mps{};        ///< for config.yaml; nothing: the default
};

/// Drives a robot through a scene for `duration` and passes the data of its sensors to the sink, in order of arrival:
/// lidar datagrams, imu.csv, NAME.tum of each odometry source, the true poses as gt.tum (100 Hz). First come a
/// config.yaml with the sensors and, if given, the box of the robot's body and its speed, and no other settings, and
/// the metadata of each Ouster, NAME.json as in a recording of locusd. `observed` receives each surface point that
/// returns an echo; `progress` the share of the duration done. Exceptions of the sink propagate.
void write_capture(
    CaptureSink& sink, const Scene& scene, const Trajectory& trajectory, Duration duration, const RobotOptions& robot,
    ObservedSpace* observed = nullptr, const std::function<void(double done)>& progress = [](double) {});

/// Creates a capture folder and writes the capture to it.
void write_capture_folder(const std::filesystem::path& folder, const Scene& scene, const Trajectory& trajectory,
                          Duration duration, const RobotOptions& robot);

} // namespace locus::sim
