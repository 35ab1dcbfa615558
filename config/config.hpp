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

/// A motion source, and where its samples come from.
struct MotionSource : MotionSourceOptions {
  std::string topic;        ///< sensor_msgs/Imu or nav_msgs/Odometry by the source's kind; empty: not from DDS
  std::string health_topic; ///< std_msgs/Bool, false is unhealthy; empty: none
  bool of_lidar = false;    ///< no key: a lidar's own unit, whose packets tell it; see with_lidar_metadata()

  bool operator==(const MotionSource&) const = default;
};

/// What the threads of the daemon ask of the operating system.
struct RealtimeOptions {
  int priority = 0;         ///< of SCHED_FIFO; 0: ordinary scheduling
  std::vector<int> cpus;    ///< that the threads may run on; empty: all
  bool lock_memory = false; ///< mlockall, so that no page is ever waited for

  bool operator==(const RealtimeOptions&) const = default;
};

/// Which ROS 2 sees the daemon among its nodes: the layout of what nodes tell of themselves changed with Iron.
enum class RosGraph { iron, humble, off };
constexpr auto names_of(RosGraph) { return std::to_array<std::string_view>({"iron", "humble", "off"}); }

/// How the results leave by DDS.
struct DdsOptions {
  int domain = 0;
  std::string interface = "lo";  ///< network interface by name
  std::string prefix = "/locus"; ///< of every topic but tf and diagnostics
  std::string frame_odom = "odom";
  std::string frame_base = "base_link";
  bool publish_tf = false;
  bool publish_cloud = false;
  bool publish_map = false;
  std::string flat_ground_topic; ///< std_msgs/Bool that overrides flat_ground; empty: none
  std::string security;          ///< folder of an enclave as ROS 2 lays it out (DDS Security); empty: none
  bool type_hashes = true;       ///< announce the types' hashes, which ROS 2 from Iron on looks for
  RosGraph ros_graph = RosGraph::iron;

  bool operator==(const DdsOptions&) const = default;
};

/// Where the daemon records what it receives.
struct RecordOptions {
  static constexpr std::uint64_t kLeastBytes = 10'000'000; ///< of each of the three

  std::string folder; ///< empty: nothing is recorded; a relative one lies in the daemon's state directory
  std::uint64_t max_bytes = 4'000'000'000;       ///< of the folder; the oldest is removed first
  double keep_s = 60;                            ///< that an incident has of what came before it; 0: none is kept
  std::uint64_t keep_bytes = 150'000'000;        ///< of memory for that, where no folder has it
  std::uint64_t incidents_bytes = 1'000'000'000; ///< of all incidents; the oldest is removed first

  bool operator==(const RecordOptions&) const = default;
};

/// Where figures are told to Prometheus.
struct MetricsOptions {
  std::string listen; ///< as parse_socket_address() takes it; empty: nowhere

  bool operator==(const MetricsOptions&) const = default;
};

/// All that can be set: the options of every module, as one file describes them. Any thread may read it.
struct Config {
  static constexpr int kVersion = 1;

  int version = kVersion;                           ///< of the file format
  bool defaults = false;                            ///< a file for the service may leave out its lidars
  std::vector<LidarOptions> lidars{LidarOptions{}}; ///< the first one gives the sweep its period
  std::vector<MotionSource> motion_sources{{{"wio", SourceKind::odometry, {}}, "/wheel_odometry", ""},
                                           {{"imu", SourceKind::imu, {}}, "/imu/data", ""}}; ///< highest priority first
  SweepOptions sweep;
  OdometryOptions odometry;
  RealtimeOptions realtime;
  DdsOptions dds;
  RecordOptions record;
  MetricsOptions metrics;

  /// As problem() of every module, and what only shows when all are seen together: names and ports used twice.
  [[nodiscard]] std::optional<std::string> problem() const;

  /// What the core is told of the motion sources.
  [[nodiscard]] std::vector<MotionSourceOptions> source_options() const {
    return {motion_sources.begin(), motion_sources.end()};
  }

  /// Has all of it computed by the instructions of one set.
  void use(Isa isa);
  bool operator==(const Config&) const = default;
};

} // namespace locus
