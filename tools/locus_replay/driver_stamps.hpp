// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "bags/bag.hpp"
#include "bags/messages.hpp"

namespace locus::tools {

/// Returns by how much the recorder's clock is ahead of that of a lidar's driver, from the first messages with lidar
/// packets on a topic; nothing if the stamps of these messages are unusable. Rewinds the bag.
std::optional<Duration> recorder_ahead_of_driver(Bag& bag, std::size_t topic);

/// Stamps that a driver gave the packets of one lidar. Unusable ones are replaced: those that do not advance within a
/// message as the lidar's clock does, and those that are more than a second off the recorder's clock unless they
/// continue those before. Then the message was recorded with its last packet, and the lidar's own clock tells when the
/// others were received. One owner.
class DriverStamps {
 public:
  /// `recorder_ahead`: see recorder_ahead_of_driver().
  explicit DriverStamps(std::optional<Duration> recorder_ahead) : recorder_ahead_(recorder_ahead) {}

  /// Corrects the stamps of a message. Precondition: it has packets.
  void correct(LidarPackets& packets, Stamp recorded);

  /// Number of messages whose stamps were replaced; messages without stamps do not count.
  [[nodiscard]] std::uint64_t replaced() const { return replaced_; }

 private:
  [[nodiscard]] bool are_usable(const LidarPackets& packets, Stamp recorded) const;

  std::optional<Duration> recorder_ahead_;
  std::optional<Stamp> latest_;          ///< of the packets so far
  std::optional<Stamp> latest_recorded_; ///< of the messages so far
  std::uint64_t replaced_ = 0;
};

} // namespace locus::tools
