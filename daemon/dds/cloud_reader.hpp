// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "daemon/dds/dds_node.hpp"
#include "drivers/clouds/cloud_view.hpp"

namespace locus::daemon {

/// Receives the clouds of one topic, in serialised form: sensor_msgs/PointCloud2, or Livox' CustomMsg, as they are
/// published. It has one DDS reader at a time, because ROS 2's tools refuse a topic with several types. One owner.
class CloudReader {
 public:
  /// Tells whether a message of this DDS type is a cloud.
  static bool carries_clouds(std::string_view dds_type);

  /// Begins with PointCloud2.
  CloudReader(const DdsNode& node, const std::string& topic, TopicQos qos);

  /// Stores the type of a writer that was discovered (Publications), if it publishes clouds on this topic.
  void discover(const std::string& topic, std::string_view dds_type);
  /// Replaces the reader by one of the type last discovered if nobody publishes clouds of the present one. Returns
  /// whether it did; handle() is then another.
  bool follow(const DdsNode& node);

  /// Returns the present type, as of read_cloud().
  [[nodiscard]] std::string_view type() const { return type_; }

  /// As of DdsReader.
  template <class Use> void take_serialised(const Use& use) {
    std::visit([&](auto& reader) { reader.take_serialised(use); }, reader_);
  }
  [[nodiscard]] std::uint32_t writers() const {
    return std::visit([](const auto& reader) { return reader.writers(); }, reader_);
  }
  [[nodiscard]] bool is_matched(dds_instance_handle_t writer) const {
    return std::visit([&](const auto& reader) { return reader.is_matched(writer); }, reader_);
  }
  [[nodiscard]] dds_entity_t handle() const {
    return std::visit([](const auto& reader) { return reader.handle(); }, reader_);
  }

 private:
  std::string topic_;
  TopicQos qos_;
  std::string_view type_, discovered_type_;
  std::variant<DdsReader<ros::PointCloud2>, DdsReader<ros::LivoxCloud>> reader_;
};

} // namespace locus::daemon
