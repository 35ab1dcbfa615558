// SPDX-License-Identifier: Apache-2.0
#include "bags/messages.hpp"

#include <algorithm>
#include <cstdint>

#include "daemon/dds/ros_messages.hpp"

namespace locus::tools {
namespace {

namespace ros = daemon::ros;

ros::Time read_time(MessageReader& reader) {
  const auto seconds = reader.number<std::int32_t>(); // unsigned in ROS 1, which makes no difference before 2038
  return {seconds, reader.number<std::uint32_t>()};
}

ros::Header read_header(MessageReader& reader) {
  if (reader.serialisation() == Serialisation::ros1)
    reader.number<std::uint32_t>(); // the sequence number, which ROS 2 has dropped
  const ros::Time stamp = read_time(reader);
  reader.skip_text();
  return {stamp, nullptr};
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

} // namespace

Stamp stamp_or(Stamp recorded, Stamp stamp) { return stamp == Stamp{} ? recorded : stamp; }

std::optional<ros::Imu> read_imu(MessageReader reader) {
  ros::Imu imu{};
  imu.header_ = read_header(reader);
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
  odometry.header_ = read_header(reader);
  reader.skip_text(); // the child's frame
  const ros::Vector3 position = read_vector(reader);
  odometry.pose_.pose_ = {{position.x_, position.y_, position.z_}, read_quaternion(reader)};
  reader.numbers(odometry.pose_.covariance_);
  odometry.twist_.twist_.linear_ = read_vector(reader);
  odometry.twist_.twist_.angular_ = read_vector(reader);
  reader.numbers(odometry.twist_.covariance_);
  return reader.whole() ? std::optional(odometry) : std::nullopt;
}

std::optional<VelodyneScan> read_velodyne_scan(MessageReader reader) {
  read_header(reader);
  VelodyneScan scan;
  for (auto left = reader.number<std::uint32_t>(); left > 0 && reader.whole(); --left) {
    VelodyneScan::Packet packet{daemon::to_stamp(read_time(reader)), {}};
    std::ranges::copy(reader.bytes(packet.payload.size()), packet.payload.begin());
    scan.packets.push_back(packet);
  }
  return reader.whole() ? std::optional(std::move(scan)) : std::nullopt;
}

} // namespace locus::tools
