// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus {

/// Keeps a flood of foreign datagrams from displacing lidar packets in a socket's buffer.
///
/// Datagrams with a foreign length or sender are received and counted like any others, up to kFlood per second. Beyond
/// that, the kernel drops them before they occupy the buffer, except one in kSample, which reveals the end of the flood
/// and a lidar with a new address. A sender is foreign only if every lidar of the port has an address, configured or
/// learnt. Datagrams with the length and the address of a lidar are never dropped here. Time is arrival time. Single
/// owner, not thread-safe. Allocates nothing.
class FloodGuard {
 public:
  static constexpr std::uint64_t kFlood = 5000; ///< per second; four lidars that are not configured send less
  static constexpr std::uint32_t kSample = 256; ///< power of two

  /// Processes the datagrams that the socket received; called before the next receive.
  void look_at(std::span<const Datagram> datagrams, UdpSocket& socket);

  /// Advances time when the socket received nothing; `now` is wall time. Needed because a flood that has ended sends no
  /// samples.
  void advance(Stamp now, UdpSocket& socket);

  /// Updates the known lidars of the port.
  void expect(const LidarRouter::Senders& senders, UdpSocket& socket);

 private:
  [[nodiscard]] bool is_foreign(const Datagram& datagram) const;
  void guard(UdpSocket& socket);
  void begin_second(Stamp now, UdpSocket& socket);

  LidarRouter::Senders senders_;
  bool guards_ = false;
  Stamp second_began_;
  std::uint64_t foreign_ = 0; ///< foreign datagrams since then, scaled by kSample while filtering
};

} // namespace locus
