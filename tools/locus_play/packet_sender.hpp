// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::tools {

/// Sends datagrams as the lidars did that they were recorded from: to the same ports, and from the same addresses as
/// far as this host has them. One owner.
class PacketSender {
 public:
  /// `interface`: that multicast leaves by; empty: as routed. `lidars`: to tell an Ouster's packets by. Throws Failure.
  PacketSender(const std::string& to, std::string interface, LidarRouter lidars);
  ~PacketSender();
  PacketSender(const PacketSender&) = delete;
  PacketSender& operator=(const PacketSender&) = delete;

  /// The clock of the lidar in the packet is moved by `shift`. Throws Failure.
  void send(const Datagram& datagram, Duration shift);

  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  /// Whether some left from another address than they were recorded from.
  [[nodiscard]] bool changed_sender() const { return changed_sender_; }

 private:
  int socket_for(std::uint32_t source_ip);

  std::uint32_t to_; ///< host byte order
  std::string interface_;
  std::map<std::uint32_t, int> sockets_; ///< by the address recorded
  LidarRouter lidars_;                   ///< never receives anything
  std::vector<std::byte> packet_;        ///< at hand
  std::uint64_t sent_ = 0;
  bool changed_sender_ = false;
};

} // namespace locus::tools
