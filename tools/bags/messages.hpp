// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/stamp.hpp"
#include "daemon/dds/ros_types.hpp"
#include "drivers/clouds/message_reader.hpp"

/// The messages that are of use in a bag, from their bytes. What breaks off in their midst is none.
namespace locus::tools {

inline constexpr std::string_view kImuType = "sensor_msgs/Imu";
inline constexpr std::string_view kOdometryType = "nav_msgs/Odometry";

/// Data packets as the lidar sent them, each with the time at which the driver received it.
struct LidarPackets {
  struct Packet {
    Stamp stamp;
    std::size_t begin, size; ///< in `bytes`
  };
  std::vector<Packet> packets;
  std::vector<std::byte> bytes;

  void add(Stamp stamp, std::span<const std::byte> payload);
  [[nodiscard]] std::span<const std::byte> payload(const Packet& packet) const {
    return std::span(bytes).subspan(packet.begin, packet.size);
  }
};

/// A type of message that holds packets of lidars.
struct PacketType {
  std::string_view name;
  std::string_view maker; ///< of the lidars; empty: of any
  /// Nothing where the message breaks off; nullptr: the packets of this maker are not decoded.
  std::optional<LidarPackets> (*read)(MessageReader reader);
};
/// All that are known.
std::span<const PacketType> packet_types();
/// nullptr for what holds no packets.
const PacketType* packet_type(std::string_view name);
/// Whether it holds packets, and of a lidar whose packets are decoded.
bool are_packets_decoded(std::string_view type_name);

/// The stamp of a header or packet, or `recorded` for one that nobody has set.
Stamp stamp_or(Stamp recorded, Stamp stamp);

/// All but the names of the frames, which stay null.
std::optional<daemon::ros::Imu> read_imu(MessageReader reader);
std::optional<daemon::ros::Odometry> read_odometry(MessageReader reader);

} // namespace locus::tools
