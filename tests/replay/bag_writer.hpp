// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/sources/motion_sample.hpp"
#include "drivers/net/datagram.hpp"
#include "support/clouds.hpp"

namespace locus::test {

enum class RosVersion { ros1, ros2 };

/// Serialised message of ROS 1 or ROS 2.
struct RecordedMessage {
  std::string topic;
  std::string type; ///< in ROS 1 spelling
  Stamp recorded;
  std::vector<std::byte> data;
};

struct ReceivedPacket {
  Stamp stamp;
  std::vector<std::byte> payload;
};

std::vector<std::byte> imu_message(const ImuSample& sample, RosVersion ros);
std::vector<std::byte> odometry_message(const OdometrySample& sample, RosVersion ros);
std::vector<std::byte> scan_message(std::span<const ReceivedPacket> packets, RosVersion ros);
std::vector<std::byte> nebula_message(std::span<const ReceivedPacket> packets, RosVersion ros);
std::vector<std::byte> pandar_message(std::span<const ReceivedPacket> packets, RosVersion ros);

/// Position of the header in hesai_ros_driver/UdpFrame, which depends on the release.
enum class HesaiHeaders { of_frame, of_packets };
std::vector<std::byte> hesai_message(std::span<const ReceivedPacket> packets, RosVersion ros,
                                     HesaiHeaders headers = HesaiHeaders::of_frame);

/// Serialises sensor_msgs/PointCloud2, or Livox' own message for a cloud with its fields.
std::vector<std::byte> cloud_message(const OwnCloud& cloud, RosVersion ros);
std::string type_of(const OwnCloud& cloud);

/// Serialises tf2_msgs/TFMessage with one transform.
std::vector<std::byte> transform_message(const std::string& parent, const std::string& child,
                                         const Pose& T_parent_child, RosVersion ros);

/// End of a ROS 1 bag.
enum class BagEnd { indexed, without_index };

/// Writes uncompressed chunks of at most ten messages, with connections before their first message and in the index.
std::string ros1_bag(std::span<const RecordedMessage> messages, BagEnd end = BagEnd::indexed);

/// Writes a database as rosbag2 does.
void write_db3(const std::filesystem::path& file, std::span<const RecordedMessage> messages,
               const std::string& serialisation = "cdr");

/// Converts a capture folder to the messages of a bag: one message per turn with the data packets of each port, on
/// `/PORT/velodyne_packets`; imu.csv on /imu/data, wio.tum, vio.tum and kio.tum on the topics of locus-sim's
/// configuration.
std::vector<RecordedMessage> messages_of(const std::filesystem::path& capture_folder, RosVersion ros,
                                         decltype(scan_message)& packet_message = scan_message);

/// Same as above, with clouds on /points in place of packets, each recorded 4 ms after its last point.
std::vector<RecordedMessage> messages_of(const std::filesystem::path& capture_folder, std::span<const OwnCloud> clouds,
                                         std::span<const Stamp> ends, RosVersion ros);

} // namespace locus::test
