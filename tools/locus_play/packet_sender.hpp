// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "drivers/lidar_router.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::tools {

/// Sends datagrams as the recorded lidars did: to the same ports, and from the same addresses if this host has them.
/// One owner.
class PacketSender {
 public:
  /// Opens the socket. `interface`: outgoing one for multicast; empty: as routed. `lidars`: to recognise an Ouster's
  /// packets. Throws Failure.
  PacketSender(const std::string& to, std::string interface, LidarRouter lidars);
  ~PacketSender();
  PacketSender(const PacketSender&) = delete;
  PacketSender& operator=(const PacketSender&) = delete;

  /// Shifts the lidar's time in the packet by `shift`. Throws Failure.
  void send(const Datagram& datagram, Duration shift);

  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  /// Returns whether some were sent from an address other than the recorded one.
  [[nodiscard]] bool changed_sender() const { return changed_sender_; }

 private:
  int socket_for(std::uint32_t source_ip);

  std::uint32_t to_; ///< host byte order
  std::string interface_;
  std::map<std::uint32_t, int> sockets_; ///< by recorded address
  LidarRouter lidars_;                   ///< for look-ups only
  std::vector<std::byte> packet_;        ///< current packet
  std::uint64_t sent_ = 0;
  bool changed_sender_ = false;
};

} // namespace locus::tools
