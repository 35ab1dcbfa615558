// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/base/stamp.hpp"
#include "drivers/net/datagram.hpp"

namespace locus {

/// Another sender of data packets to a lidar's port.
struct OtherSender {
  std::uint32_t ip = 0;      ///< host byte order
  std::uint64_t packets = 0; ///< rejected packets from this sender
  Stamp last_received;       ///< arrival of the latest of them
};
/// The first other senders, in order of arrival; entries with zero packets are unused.
using OtherSenders = std::array<OtherSender, 4>;

/// Address of one lidar: configured, or else that of the first sender of a good data packet. Another sender replaces a
/// learnt one only after one second of silence. Addresses are in host byte order. Single owner, not thread-safe.
class LidarSender {
 public:
  explicit LidarSender(std::optional<std::uint32_t> configured_ip) : configured_ip_(configured_ip) {}

  /// Returns true if a datagram is from the lidar, or may be from it.
  [[nodiscard]] bool may_have_sent(const Datagram& datagram) const;
  /// Returns true if the lidar has been silent for so long that another may send instead.
  [[nodiscard]] bool is_silent_at(Stamp now) const;

  /// Learns the address from a good data packet.
  void accept(const Datagram& datagram);
  /// Counts a data packet that may_have_sent() excludes.
  void reject(const Datagram& datagram);

  /// Configured or learnt; empty before the first good packet.
  [[nodiscard]] std::optional<std::uint32_t> ip() const { return configured_ip_ ? configured_ip_ : learnt_ip_; }
  /// Arrival of the latest accepted packet; Stamp{} before the first.
  [[nodiscard]] Stamp last_received() const { return last_received_; }
  /// Source address of the last rejected packet.
  [[nodiscard]] std::optional<std::uint32_t> rejected_ip() const { return rejected_ip_; }
  [[nodiscard]] const OtherSenders& others() const { return others_; }

 private:
  std::optional<std::uint32_t> configured_ip_, learnt_ip_, rejected_ip_;
  Stamp last_received_;
  OtherSenders others_{};
};

} // namespace locus
