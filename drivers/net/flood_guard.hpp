// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/net/udp_socket.hpp"

namespace locus {

/// Keeps a flood out of a socket's buffer, where it would take the place of the lidars' packets.
///
/// A datagram that is no lidar's by its length or its sender is handed over and counted with its reason like any other,
/// up to kFlood of them in a second. Beyond that the kernel drops them before they take room, all but one in kSample,
/// by which the end of the flood, and a lidar under a new address, are told. A sender is foreign only while every lidar
/// of the port has an address, configured or learnt. What has the length and the address of a lidar is never dropped
/// here. Time is that of arrival. One owner. Allocates nothing.
class FloodGuard {
 public:
  static constexpr std::uint64_t kFlood = 5000; ///< a second; four lidars that nobody configured send less
  static constexpr std::uint32_t kSample = 256; ///< a power of two

  /// To be told of what the socket has received, before it receives more.
  void look_at(std::span<const Datagram> datagrams, UdpSocket& socket);

  /// To be told by the wall clock that the socket has nothing: a flood that has ended sends no sample to tell it by.
  void hear_nothing(Stamp now, UdpSocket& socket);

  /// Who the lidars of the port are by now.
  void expect(const LidarRouter::Senders& senders, UdpSocket& socket);

 private:
  [[nodiscard]] bool is_foreign(const Datagram& datagram) const;
  void guard(UdpSocket& socket);
  void begin_second(Stamp now, UdpSocket& socket);

  LidarRouter::Senders senders_;
  bool guards_ = false;
  Stamp second_began_;
  std::uint64_t foreign_ = 0; ///< since then, those that the samples stand for included
};

} // namespace locus
