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
  std::string type; ///< as ROS 1 writes it, for ROS 2 too: sensor_msgs/Imu
  Serialisation serialisation;

  auto operator<=>(const BagTopic&) const = default;
};

/// ROS' own bound on a name is far below; a damaged file may claim that it is as long as the file.
inline constexpr std::size_t kMaxNameBytes = 4096;
/// As many as MCAP has numbers for.
inline constexpr std::size_t kMaxTopics = 65535;

/// Times of reception that are later are absurd: their differences could overflow.
inline constexpr std::int64_t kMaxBagTime_ns = 4'000'000'000'000'000'000;

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

  /// The next message, valid until the next call; nullptr at the end, and where the bag breaks off. A topic that the
  /// bag did not tell beforehand is added before its first message.
  virtual const BagMessage* next() = 0;
  /// next() begins with the first message again.
  virtual void rewind() = 0;

  /// One line for the user each, about what was met so far.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;
  /// Share of the messages that next() is through with, 0..1.
  [[nodiscard]] virtual double progress() const = 0;

 protected:
  /// The index of the topic, a new one if need be; nothing for one beyond the bounds, which is left out.
  std::optional<std::size_t> index_of(BagTopic topic);

  /// What messages of this number are of from now on. Those of a topic beyond the bounds are left out.
  void declare(std::int64_t number, BagTopic topic);
  [[nodiscard]] std::optional<std::size_t> topic_of(std::int64_t number) const;

  /// One line for the user, if topics were left out.
  void tell_of_bounds(const std::string& file, std::vector<std::string>& lines) const;

 private:
  std::vector<BagTopic> topics_;
  std::map<BagTopic, std::size_t> indices_;
  std::map<std::int64_t, std::size_t> declared_; ///< indices, by number
  bool is_beyond_bounds_ = false;
};

/// The type as ROS 1 writes it: ROS 2 puts /msg between package and name.
std::string ros1_type(std::string type);

/// The beginning of what may be any bytes, for a line to the user.
std::string printable(std::string_view text);

/// Why the file cannot be opened and what to do, without its name; nothing if it can.
std::optional<std::string> why_unreadable(const std::filesystem::path& file);

/// One line for the user about messages left out for kMaxBagTime_ns.
std::string timeless_messages(const std::string& file, std::uint64_t count);

/// Whether this is for open_bag() to read or to refuse: judged by name and first bytes.
bool looks_like_bag(const std::filesystem::path& where);

/// A ROS 1 bag, an MCAP file of either ROS, or a ROS 2 bag: its folder, or a .db3 file of it. Fails with one line for
/// the user.
Expected<std::unique_ptr<Bag>, std::string> open_bag(const std::filesystem::path& where);

} // namespace locus::tools
