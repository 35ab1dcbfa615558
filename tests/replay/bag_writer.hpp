// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/sources/motion_sample.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::test {

enum class RosVersion { ros1, ros2 };

/// Bytes as a message has them after its ROS' serialisation.
struct RecordedMessage {
  std::string topic;
  std::string type; ///< as ROS 1 writes it
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

/// How a ROS 1 bag ends.
enum class BagEnd { indexed, without_index };

/// Plain chunks of at most ten messages, connections before their first message and in the index.
std::string ros1_bag(std::span<const RecordedMessage> messages, BagEnd end = BagEnd::indexed);

/// A database as rosbag2 writes it.
void write_db3(const std::filesystem::path& file, std::span<const RecordedMessage> messages,
               const std::string& serialisation = "cdr");

/// What a bag of a capture folder would hold: the data packets to each port on a topic, those of a turn in one message,
/// on `/PORT/velodyne_packets`; imu.csv on /imu/data and wio.tum on /wheel_odometry.
std::vector<RecordedMessage> messages_of(const std::filesystem::path& capture_folder, RosVersion ros);

} // namespace locus::test
