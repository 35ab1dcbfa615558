// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/options.hpp"
#include "drivers/lidar_options.hpp"

namespace locus {

/// Motion source and the origin of its samples.
struct MotionSource : MotionSourceOptions {
  std::string topic;        ///< sensor_msgs/Imu or nav_msgs/Odometry, by kind; empty: not from DDS
  std::string health_topic; ///< std_msgs/Bool, false is unhealthy; empty: none
  bool of_lidar = false;    ///< not a key: IMU inside a lidar, read from its packets; see with_lidar_metadata()

  bool operator==(const MotionSource&) const = default;
};

/// Requests of the daemon's threads to the operating system.
struct RealtimeOptions {
  int priority = 0;         ///< SCHED_FIFO priority; 0: ordinary scheduling
  std::vector<int> cpus;    ///< CPUs that the threads may run on; empty: all
  bool lock_memory = false; ///< mlockall(), to avoid page faults

  bool operator==(const RealtimeOptions&) const = default;
};

/// ROS 2 version to which the daemon announces itself as a node; the format of the announcement changed with Iron.
enum class RosGraph { iron, humble, off };
constexpr auto names_of(RosGraph) { return std::to_array<std::string_view>({"iron", "humble", "off"}); }

/// Output over DDS.
struct DdsOptions {
  int domain = 0;
  std::string interface = "lo";  ///< network interface by name
  std::string prefix = "/locus"; ///< prefix of all topics except tf and diagnostics
  std::string frame_odom = "odom";
  std::string frame_base = "base_link";
  bool publish_tf = false;
  bool publish_cloud = false;
  bool publish_map = false;
  std::string flat_ground_topic; ///< std_msgs/Bool that overrides flat_ground; empty: none
  std::string security;          ///< folder of a ROS 2 security enclave (DDS Security); empty: none
  bool type_hashes = true;       ///< announce type hashes, expected by ROS 2 Iron and later
  RosGraph ros_graph = RosGraph::iron;

  bool operator==(const DdsOptions&) const = default;
};

/// Recording of the daemon's input.
struct RecordOptions {
  static constexpr std::uint64_t kLeastBytes = 10'000'000; ///< lower limit of the three sizes

  std::string folder;                            ///< empty: no recording; relative to the daemon's state directory
  std::uint64_t max_bytes = 4'000'000'000;       ///< size limit of the folder; the oldest input is removed first
  double keep_s = 60;                            ///< input stored with an incident, up to it; 0: no incidents
  std::uint64_t keep_bytes = 150'000'000;        ///< memory for that input if no folder is set
  std::uint64_t incidents_bytes = 1'000'000'000; ///< size limit of all incidents; the oldest is removed first

  bool operator==(const RecordOptions&) const = default;
};

/// Endpoint of the Prometheus metrics.
struct MetricsOptions {
  std::string listen; ///< address in the syntax of parse_socket_address(); empty: none

  bool operator==(const MetricsOptions&) const = default;
};

/// Complete configuration: the options of all modules, as in one file. Any thread may read it.
struct Config {
  static constexpr int kVersion = 1;

  int version = kVersion;                           ///< version of the file format
  bool defaults = false;                            ///< allows a service's file without lidars
  std::vector<LidarOptions> lidars{LidarOptions{}}; ///< the first one determines the sweep period
  std::vector<MotionSource> motion_sources{{{"wio", SourceKind::odometry, {}}, "/wheel_odometry", ""},
                                           {{"imu", SourceKind::imu, {}}, "/imu/data", ""}}; ///< highest priority first
  SweepOptions sweep;
  OdometryOptions odometry;
  RealtimeOptions realtime;
  DdsOptions dds;
  RecordOptions record;
  MetricsOptions metrics;

  /// Returns the problems of all modules and those across modules, such as names and ports used twice.
  [[nodiscard]] std::optional<std::string> problem() const;

  /// Returns the core's part of the motion source options.
  [[nodiscard]] std::vector<MotionSourceOptions> source_options() const {
    return {motion_sources.begin(), motion_sources.end()};
  }

  /// Selects the instruction set of all modules.
  void use(Isa isa);
  bool operator==(const Config&) const = default;
};

} // namespace locus
