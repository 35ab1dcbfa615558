// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/dds/ros_types.hpp"

/// Messages as DDS has them on the wire, for who writes them to a file.
namespace locus::daemon::ros {

/// Replaces `out` by the message in little-endian CDR behind its four bytes of encapsulation. Any thread.
void serialise(const void* message, const dds_topic_descriptor_t& type, std::vector<std::byte>& out);
template <class Message> void serialise(const Message& message, std::vector<std::byte>& out) {
  serialise(&message, *type_of<Message>().descriptor, out);
}

/// "nav_msgs/msg/Odometry", from what DDS calls it.
std::string name_in_ros2(const dds_topic_descriptor_t& type);

} // namespace locus::daemon::ros
