// SPDX-License-Identifier: Apache-2.0
#include "bags/messages.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "daemon/dds/ros_messages.hpp"
#include "drivers/velodyne/model.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

ros::Time read_time(MessageReader& reader) {
  const auto seconds = reader.number<std::int32_t>(); // unsigned in ROS 1; identical before 2038
  return {seconds, reader.number<std::uint32_t>()};
}

struct Header {
  ros::Time stamp;
  std::string_view frame;

  /// Returns the message's header without the frame.
  [[nodiscard]] ros::Header nameless() const { return {stamp, nullptr}; }
};

Header read_header(MessageReader& reader) {
  if (reader.serialisation() == Serialisation::ros1)
    reader.number<std::uint32_t>(); // sequence number, dropped in ROS 2
  const ros::Time stamp = read_time(reader);
  return {stamp, reader.text()};
}

ros::Vector3 read_vector(MessageReader& reader) {
  std::array<double, 3> v{};
  reader.numbers(v);
  return {v[0], v[1], v[2]};
}

ros::Quaternion read_quaternion(MessageReader& reader) {
  std::array<double, 4> q{};
  reader.numbers(q);
  return {q[0], q[1], q[2], q[3]};
}

/// Reads a header and stamped packets, each as `payload` reads it.
template <class Payload> std::optional<LidarPackets> read_packets(MessageReader reader, const Payload& payload) {
  LidarPackets packets;
  packets.frame = read_header(reader).frame;
  for (auto left = reader.number<std::uint32_t>(); left > 0 && reader.whole(); --left) {
    const Stamp stamp = daemon::to_stamp(read_time(reader));
    packets.add(stamp, payload(reader));
  }
  return reader.whole() ? std::optional(std::move(packets)) : std::nullopt;
}

std::optional<LidarPackets> read_velodyne_scan(MessageReader reader) {
  return read_packets(reader, [](MessageReader& r) { return r.bytes(velodyne::kDataPacketBytes); });
}

/// Reads one packet without a stamp. Older drivers append a byte; the lengths of Ouster's packets are multiples of 4.
std::optional<LidarPackets> read_ouster_packet(MessageReader reader) {
  constexpr std::size_t kMultiple = 4;
  const std::span<const std::byte> bytes = reader.sequence();
  LidarPackets packets;
  packets.add(Stamp{}, bytes.first(bytes.size() - (bytes.size() % kMultiple == 1 ? 1 : 0)));
  return reader.whole() ? std::optional(std::move(packets)) : std::nullopt;
}

std::optional<LidarPackets> read_nebula_packets(MessageReader reader) {
  return read_packets(reader, [](MessageReader& r) { return r.sequence(); });
}

/// Reads an array of the size of an Ethernet frame and the length of the packet in it.
std::optional<LidarPackets> read_pandar_scan(MessageReader reader) {
  constexpr std::size_t kArrayBytes = 1500;
  return read_packets(reader, [](MessageReader& r) {
    const std::span<const std::byte> all = r.bytes(kArrayBytes);
    return all.first(std::min<std::size_t>(r.number<std::uint32_t>(), all.size()));
  });
}

/// Reads either layout: releases of Hesai's driver differ in whether the frame and each of its packets begin with a
/// header. The packet is followed by its size, which identifies the layout; a frame without packets is rejected.
std::optional<LidarPackets> read_hesai_frame(MessageReader message) {
  for (const bool has_header : {true, false}) {
    for (const bool has_packet_headers : {false, true}) {
      MessageReader reader = message;
      if (has_header)
        read_header(reader);
      LidarPackets packets;
      auto left = reader.number<std::uint32_t>();
      for (bool fits = true; left > 0 && reader.whole() && fits; left -= fits ? 1U : 0U) {
        if (has_packet_headers)
          read_header(reader);
        const Stamp stamp = daemon::to_stamp(read_time(reader));
        const std::span<const std::byte> payload = reader.sequence();
        fits = reader.number<std::uint32_t>() == payload.size() && !payload.empty();
        packets.add(stamp, payload);
      }
      if (left == 0 && !packets.packets.empty() && reader.whole() && reader.rest().empty())
        return packets;
    }
  }
  return std::nullopt;
}

} // namespace

Stamp stamp_or(Stamp recorded, Stamp stamp) { return stamp == Stamp{} ? recorded : stamp; }

std::string_view frame_of(MessageReader reader) {
  const std::string_view frame = read_header(reader).frame;
  return reader.whole() ? frame : std::string_view{};
}

std::string_view child_frame_of(MessageReader odometry) {
  read_header(odometry);
  const std::string_view frame = odometry.text();
  return odometry.whole() ? frame : std::string_view{};
}

std::optional<ros::Imu> read_imu(MessageReader reader) {
  ros::Imu imu{};
  imu.header_ = read_header(reader).nameless();
  imu.orientation_ = read_quaternion(reader);
  reader.numbers(imu.orientation_covariance_);
  imu.angular_velocity_ = read_vector(reader);
  reader.numbers(imu.angular_velocity_covariance_);
  imu.linear_acceleration_ = read_vector(reader);
  reader.numbers(imu.linear_acceleration_covariance_);
  return reader.whole() ? std::optional(imu) : std::nullopt;
}

std::optional<ros::Odometry> read_odometry(MessageReader reader) {
  ros::Odometry odometry{};
  odometry.header_ = read_header(reader).nameless();
  reader.text(); // child frame
  const ros::Vector3 position = read_vector(reader);
  odometry.pose_.pose_ = {{position.x_, position.y_, position.z_}, read_quaternion(reader)};
  reader.numbers(odometry.pose_.covariance_);
  odometry.twist_.twist_.linear_ = read_vector(reader);
  odometry.twist_.twist_.angular_ = read_vector(reader);
  reader.numbers(odometry.twist_.covariance_);
  return reader.whole() ? std::optional(odometry) : std::nullopt;
}

void LidarPackets::add(Stamp stamp, std::span<const std::byte> payload) {
  packets.push_back({stamp, bytes.size(), payload.size()});
  bytes.insert(bytes.end(), payload.begin(), payload.end());
}

std::span<const PacketType> packet_types() {
  static constexpr std::array kTypes{PacketType{"velodyne_msgs/VelodyneScan", read_velodyne_scan},
                                     PacketType{"nebula_msgs/NebulaPackets", read_nebula_packets},
                                     PacketType{"ouster_ros/PacketMsg", read_ouster_packet},
                                     PacketType{"ouster_msgs/PacketMsg", read_ouster_packet},
                                     PacketType{"ouster_sensor_msgs/PacketMsg", read_ouster_packet},
                                     PacketType{"pandar_msgs/PandarScan", read_pandar_scan},
                                     PacketType{"hesai_ros_driver/UdpFrame", read_hesai_frame}};
  return kTypes;
}

const PacketType* packet_type(std::string_view name) {
  const auto found = std::ranges::find(packet_types(), name, &PacketType::name);
  return found != packet_types().end() ? &*found : nullptr;
}

bool is_ouster_type(std::string_view name) { return name.starts_with("ouster_") && packet_type(name) != nullptr; }

} // namespace locus::tools
