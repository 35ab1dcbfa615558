// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "drivers/clouds/message_reader.hpp"

namespace locus::tools {

struct BagTopic {
  std::string name;
  std::string type; ///< in ROS 1 notation, also for ROS 2: sensor_msgs/Imu
  Serialisation serialisation;

  auto operator<=>(const BagTopic&) const = default;
};

/// Far above ROS' own limit on a name; a damaged file may claim a length up to that of the file.
inline constexpr std::size_t kMaxNameBytes = 4096;
/// Limit of MCAP's channel ids.
inline constexpr std::size_t kMaxTopics = 65535;

/// Later reception times are rejected: their differences could overflow.
inline constexpr std::int64_t kMaxBagTime_ns = 4'000'000'000'000'000'000;

/// Message as stored in the bag. Does not own its data.
struct BagMessage {
  std::size_t topic; ///< index in Bag::topics()
  Stamp recorded;    ///< reception time at the recorder
  std::span<const std::byte> data;
};

/// Messages recorded by ROS, in file order: the order of reception, except in bags that were sorted or merged. One
/// owner.
class Bag {
 public:
  virtual ~Bag() = default;

  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }

  /// Returns the next message, valid until the next call; nullptr at the end, or where the bag is truncated. Adds a
  /// topic that the bag did not list in advance before its first message.
  virtual const BagMessage* next() = 0;
  /// Restarts next() at the first message.
  virtual void rewind() = 0;

  /// Returns a line for the user per problem met so far.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;
  /// Share of the messages that next() has returned, 0..1.
  [[nodiscard]] virtual double progress() const = 0;

 protected:
  /// Returns the index of the topic, adding it if needed; nothing beyond the limits: the topic is dropped.
  std::optional<std::size_t> index_of(BagTopic topic);

  /// Maps messages of this number to the topic from now on. Drops those of a topic beyond the limits.
  void declare(std::int64_t number, BagTopic topic);
  [[nodiscard]] std::optional<std::size_t> topic_of(std::int64_t number) const;

  /// Adds one line for the user if topics were dropped.
  void add_bound_warnings(const std::string& file, std::vector<std::string>& lines) const;

 private:
  std::vector<BagTopic> topics_;
  std::map<BagTopic, std::size_t> indices_;
  std::map<std::int64_t, std::size_t> declared_; ///< topic indices, by number
  bool is_beyond_bounds_ = false;
};

/// Converts a type to ROS 1 notation: ROS 2 puts /msg between package and name.
std::string ros1_type(std::string type);

/// Returns the beginning of arbitrary bytes in printable form, for a line to the user.
std::string printable(std::string_view text);

/// Returns why the file cannot be opened and a remedy, without its name; nothing if it can.
std::optional<std::string> why_unreadable(const std::filesystem::path& file);

/// Formats the line for the user about messages dropped for kMaxBagTime_ns.
std::string timeless_messages(const std::string& file, std::uint64_t count);

/// Returns whether open_bag() should read or reject this, judged by name and first bytes.
bool looks_like_bag(const std::filesystem::path& where);

/// Opens a ROS 1 bag, an MCAP file of either ROS, or a ROS 2 bag: its folder, or one of its .db3 files. Fails with one
/// line for the user.
Expected<std::unique_ptr<Bag>, std::string> open_bag(const std::filesystem::path& where);

} // namespace locus::tools
