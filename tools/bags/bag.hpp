// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bags/message_reader.hpp"
#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus::tools {

struct BagTopic {
  std::string name;
  std::string type; ///< as ROS 1 writes it, for ROS 2 too: sensor_msgs/Imu
};

/// A message as it lies in the bag. Owns nothing.
struct BagMessage {
  std::size_t topic; ///< index in Bag::topics()
  Stamp recorded;    ///< when the recorder received it
  std::span<const std::byte> data;
};

/// The messages that ROS recorded, in the order in which they lie in the file: that of their reception, but for bags
/// that somebody sorted or merged. One owner.
class Bag {
 public:
  virtual ~Bag() = default;

  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }
  [[nodiscard]] virtual Serialisation serialisation() const = 0;

  /// The next message, valid until the next call; nullptr at the end, and where the bag breaks off.
  virtual const BagMessage* next() = 0;
  /// next() begins with the first message again.
  virtual void rewind() = 0;

  /// One line for the user each, about what was met so far.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;
  /// Share of the messages that next() is through with, 0..1.
  [[nodiscard]] virtual double progress() const = 0;

 protected:
  /// The index of the topic, a new one if need be.
  std::size_t topic_index(const std::string& name, const std::string& type);

 private:
  std::vector<BagTopic> topics_;
};

/// Whether this is for open_bag() to read or to refuse: judged by name and first bytes.
bool looks_like_bag(const std::filesystem::path& where);

/// A ROS 1 bag, or a ROS 2 bag: its folder, or a .db3 file of it. Fails with one line for the user.
Expected<std::unique_ptr<Bag>, std::string> open_bag(const std::filesystem::path& where);

} // namespace locus::tools
