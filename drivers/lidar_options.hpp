// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/isa.hpp"
#include "core/base/names.hpp"
#include "core/base/pose.hpp"
#include "drivers/clouds/cloud_doubt.hpp"

namespace locus {

namespace velodyne {
enum class Model : std::uint8_t; // opaque: an option names a model and knows nothing of its geometry
}
namespace hesai {
enum class Model : std::uint8_t;
}

/// Whose clock stamps the measurements of a lidar. `sensor`: its time of hour is taken as true; `receive`: the stamps
/// of reception fix the offset and the sensor's clock is the ruler; `automatic` (key: auto): `sensor` while it says
/// that it is locked to PPS, else `receive`.
enum class LidarTime : std::uint8_t { automatic, sensor, receive };
constexpr auto names_of(LidarTime) { return std::to_array<std::string_view>({"auto", "sensor", "receive"}); }

/// One lidar: how its packets are told from others and how they are read, or on which topic its clouds come; and where
/// it sits on the robot.
struct LidarOptions {
  std::string name = "front";
  bool ouster = false;                  ///< key model: Ouster
  std::optional<velodyne::Model> model; ///< nothing (key: auto, or another maker's): told from the packets
  std::optional<hesai::Model> hesai;    ///< the same key
  std::uint16_t port = 2368; ///< UDP port that its data packets are sent to; 0: as an Ouster's metadata has it
  std::optional<std::uint32_t>
      source_ip; ///< of the sender, host byte order; nothing (key: any): whoever sends to the port
  std::optional<std::uint32_t>
      multicast_ip; ///< group that it sends to, host byte order; nothing (key: none): it sends to this host or to all
  LidarTime time = LidarTime::automatic;
  std::string calibration; ///< file of this unit's laser angles; empty: the model's built-in table
  std::string metadata;    ///< file of an Ouster's own, see ouster::read_metadata(); of others empty
  std::string topic;       ///< of clouds that another program makes of its packets; empty: the packets come here
  PointTimesFrom point_times = PointTimesFrom::automatic; ///< of these clouds
  Pose T_base_lidar;
  std::uint16_t imu_port = 0; ///< no key: of an Ouster, as its metadata has it; 0: it brings no inertial unit
  Isa isa = best_isa();       ///< no key: a result of the machine, or of the environment variable LOCUS_ISA

  [[nodiscard]] bool gives_clouds() const { return !topic.empty(); }
  /// Made by Ouster, as is known from the start.
  [[nodiscard]] bool is_ouster() const { return ouster || !metadata.empty(); }
  /// Made by Hesai, as is known from the start: its files of angles are of this kind, Velodyne's are YAML.
  [[nodiscard]] bool is_hesai() const { return hesai || (!model && !is_ouster() && calibration.ends_with(".csv")); }
  /// Whether only the packets tell if it is a Velodyne or a Hesai.
  [[nodiscard]] bool is_of_any_maker() const { return !model && !is_ouster() && !is_hesai() && calibration.empty(); }
  bool operator==(const LidarOptions&) const = default;
};

} // namespace locus
