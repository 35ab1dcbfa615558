// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "bags/mcap_writer.hpp"
#include "bags/ros_definitions.hpp"
#include "core/base/stamp.hpp"
#include "daemon/dds/cdr.hpp"

namespace locus::tools {

/// MCAP file of ROS 2 messages. One owner. Throws Failure as McapWriter does.
class McapMessages {
 public:
  explicit McapMessages(const std::filesystem::path& file) : writer_(file) {}

  /// Adds a topic; returns the channel for write().
  template <class Message> std::uint16_t add_topic(const std::string& topic) {
    const daemon::ros::Type type = daemon::ros::type_of<Message>();
    const std::string name = daemon::ros::name_in_ros2(*type.descriptor);
    return writer_.add(
        {topic, name, ros2_definition(name), type.hash.empty() ? "" : fmt::format("RIHS01_{}", type.hash)});
  }
  template <class Message> void write(std::uint16_t channel, Stamp stamp, const Message& message) {
    daemon::ros::serialise(message, serialised_);
    writer_.write(channel, stamp, serialised_);
  }
  void close() { writer_.close(); }

 private:
  McapWriter writer_;
  std::vector<std::byte> serialised_;
};

} // namespace locus::tools
