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

namespace locus {

namespace velodyne {
enum class Model : std::uint8_t; // opaque: an option names a model and knows nothing of its geometry
}

/// Whose clock stamps the measurements of a lidar. `sensor`: its time of hour is taken as true; `receive`: the stamps
/// of reception fix the offset and the sensor's clock is the ruler; `automatic` (key: auto): `sensor` while it says
/// that it is locked to PPS, else `receive`.
enum class LidarTime : std::uint8_t { automatic, sensor, receive };
constexpr auto names_of(LidarTime) { return std::to_array<std::string_view>({"auto", "sensor", "receive"}); }

/// One lidar: how its packets are told from others, how they are read, and where it sits on the robot.
struct LidarOptions {
  std::string name = "front";
  std::optional<velodyne::Model> model; ///< nothing (key: auto): told from the packets
  std::uint16_t port = 2368;            ///< UDP port that its data packets are sent to
  std::optional<std::uint32_t>
      source_ip; ///< of the sender, host byte order; nothing (key: any): whoever sends to the port
  std::optional<std::uint32_t>
      multicast_ip; ///< group that it sends to, host byte order; nothing (key: none): it sends to this host or to all
  LidarTime time = LidarTime::automatic;
  std::string calibration; ///< file of per-laser corrections; empty: the model's built-in table
  Pose T_base_lidar;
  Isa isa = best_isa(); ///< no key: a result of the machine, or of the environment variable LOCUS_ISA

  bool operator==(const LidarOptions&) const = default;
};

} // namespace locus
