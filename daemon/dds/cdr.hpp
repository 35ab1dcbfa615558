// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/dds/ros_types.hpp"

/// Serialisation of messages in the wire format of DDS, for storage in files.
namespace locus::daemon::ros {

/// Replaces `out` by the message in little-endian CDR, after a four-byte encapsulation header. Any thread.
void serialise(const void* message, const dds_topic_descriptor_t& type, std::vector<std::byte>& out);
template <class Message> void serialise(const Message& message, std::vector<std::byte>& out) {
  serialise(&message, *type_of<Message>().descriptor, out);
}

/// Converts a DDS type name to ROS 2's, e.g. "nav_msgs/msg/Odometry".
std::string name_in_ros2(const dds_topic_descriptor_t& type);

} // namespace locus::daemon::ros
