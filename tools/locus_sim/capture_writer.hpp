// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "locus_sim/capture_sink.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/seen_space.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "locus_sim/synthetic_sources.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

struct NamedLidar {
  std::string name = "front";
  SyntheticLidarOptions options;
  std::optional<Pose> T_base_believed{}; ///< what config.yaml says of its place; nothing: the truth
  std::optional<ImuFaults> imu{};        ///< of an Ouster's own unit
};

struct MountedImu {
  ImuFaults faults;
  Pose T_base_imu;
  std::optional<Pose> T_base_believed{}; ///< as of a lidar
};

struct NamedOdometry {
  std::string name = "wio";
  std::string topic = "/wheel_odometry";
  double rate_hz = 50;
  OdometryFaults faults;
};

/// What a robot carries, for a capture folder.
struct RobotOptions {
  std::vector<NamedLidar> lidars{{}};
  std::optional<MountedImu> imu = MountedImu{}; ///< 200 Hz, nothing: no IMU
  std::vector<NamedOdometry> odometry{{}};      ///< the best first
  std::uint64_t seed = 1;                       ///< of IMU and odometry; lidars have their own
  std::optional<Bounds> body_box{};             ///< base frame, of which config.yaml says that it holds the robot
  std::optional<double> max_speed_mps{};        ///< that config.yaml allows; nothing: the default
};

/// Drives a robot through a scene for `duration` and hands over, in the order of arrival, what its sensors saw: the
/// datagrams of its lidars, imu.csv, NAME.tum of each odometry source, the true poses as gt.tum (100 Hz); first of all
/// a config.yaml that names the sensors, and the box of the robot's body and its speed where there are any, and
/// overrides nothing else, and the metadata of each Ouster, NAME.json as in a recording of locusd. `seen` takes note of
/// every surface point that an echo comes from; `progress` is told what share of the duration is done. What the sink
/// throws passes through.
void write_capture(
    CaptureSink& sink, const Scene& scene, const Trajectory& trajectory, Duration duration, const RobotOptions& robot,
    SeenSpace* seen = nullptr, const std::function<void(double done)>& progress = [](double) {});

/// The same, as a capture folder, which it makes.
void write_capture_folder(const std::filesystem::path& folder, const Scene& scene, const Trajectory& trajectory,
                          Duration duration, const RobotOptions& robot);

} // namespace locus::sim
