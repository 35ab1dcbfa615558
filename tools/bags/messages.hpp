// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/stamp.hpp"
#include "daemon/dds/ros_types.hpp"
#include "drivers/clouds/message_reader.hpp"

/// Decodes the relevant messages of a bag. Truncated messages are rejected.
namespace locus::tools {

inline constexpr std::string_view kImuType = "sensor_msgs/Imu";
inline constexpr std::string_view kOdometryType = "nav_msgs/Odometry";

/// Data packets as sent by the lidar, each with its reception time at the driver.
struct LidarPackets {
  struct Packet {
    Stamp stamp;
    std::size_t begin, size; ///< offset and length in `bytes`
  };
  std::string frame; ///< frame_id; empty if the message has none
  std::vector<Packet> packets;
  std::vector<std::byte> bytes;

  void add(Stamp stamp, std::span<const std::byte> payload);
  [[nodiscard]] std::span<const std::byte> payload(const Packet& packet) const {
    return std::span(bytes).subspan(packet.begin, packet.size);
  }
};

/// Message type that holds lidar packets.
struct PacketType {
  std::string_view name;
  /// Returns nothing for a truncated message.
  std::optional<LidarPackets> (*read)(MessageReader reader);
};
/// Returns all known types.
std::span<const PacketType> packet_types();
/// Returns nullptr for a type without packets.
const PacketType* packet_type(std::string_view name);
/// Returns whether the type is that of ouster-ros, in any of its packages: one packet, of the lidar or of its IMU.
bool is_ouster_type(std::string_view name);

/// Returns the stamp of a header, or `recorded` if it was not set.
Stamp stamp_or(Stamp recorded, Stamp stamp);

/// Reads the frame of a message that begins with a header; empty if it is truncated. Refers to the message.
std::string_view frame_of(MessageReader reader);

/// Reads the child frame of an odometry likewise.
std::string_view child_frame_of(MessageReader odometry);

/// Reads everything but the frame names, which stay null.
std::optional<daemon::ros::Imu> read_imu(MessageReader reader);
std::optional<daemon::ros::Odometry> read_odometry(MessageReader reader);

} // namespace locus::tools
