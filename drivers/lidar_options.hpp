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
enum class Model : std::uint8_t; // opaque: an option names a model without depending on its geometry
}
namespace hesai {
enum class Model : std::uint8_t;
}

/// Clock that stamps the measurements of a lidar. `sensor`: the sensor's time of hour is trusted; `receive`: the
/// reception stamps fix the offset, the sensor's clock gives the intervals; `automatic` (key: auto): `sensor` while the
/// lidar reports that it is locked to PPS, otherwise `receive`.
enum class LidarTime : std::uint8_t { automatic, sensor, receive };
constexpr auto names_of(LidarTime) { return std::to_array<std::string_view>({"auto", "sensor", "receive"}); }

/// Configuration of one lidar: how its packets are identified and decoded, or the topic of its clouds; and its
/// extrinsics.
struct LidarOptions {
  std::string name = "front";
  bool ouster = false;                  ///< key model: Ouster
  std::optional<velodyne::Model> model; ///< empty (key: auto, or another maker's model): recognised from the packets
  std::optional<hesai::Model> hesai;    ///< same key
  std::uint16_t port = 2368; ///< UDP destination port of its data packets; 0: taken from an Ouster's metadata
  std::optional<std::uint32_t> source_ip;    ///< sender's address, host byte order; empty (key: any): any sender
  std::optional<std::uint32_t> multicast_ip; ///< group, host byte order; empty (key: none): unicast or broadcast
  LidarTime time = LidarTime::automatic;
  std::string calibration;   ///< file with the laser angles of this unit; empty: built-in table of the model
  std::string metadata;      ///< an Ouster's metadata file, see ouster::read_metadata(); empty for other makers
  std::string metadata_text; ///< no key: the metadata themselves, from a bag; `metadata` then names their origin
  std::string topic;         ///< topic of clouds made from its packets elsewhere; empty: packets are received
  PointTimesFrom point_times = PointTimesFrom::automatic; ///< source of the point times of these clouds
  Pose T_base_lidar;
  std::uint16_t imu_port = 0; ///< no key: from an Ouster's metadata; 0: no IMU
  Isa isa = best_isa();       ///< no key: determined by the machine or by the environment variable LOCUS_ISA

  [[nodiscard]] bool gives_clouds() const { return !topic.empty(); }
  /// Returns true if the configuration identifies an Ouster.
  [[nodiscard]] bool is_ouster() const { return ouster || !metadata.empty(); }
  /// Returns true if the configuration identifies a Hesai; its calibration files are CSV, a Velodyne's are YAML.
  [[nodiscard]] bool is_hesai() const { return hesai || (!model && !is_ouster() && calibration.ends_with(".csv")); }
  /// Returns true if only the packets can distinguish a Velodyne from a Hesai.
  [[nodiscard]] bool is_of_any_maker() const { return !model && !is_ouster() && !is_hesai() && calibration.empty(); }
  bool operator==(const LidarOptions&) const = default;
};

} // namespace locus
