// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "drivers/net/datagram.hpp"

namespace locus::tools {

/// Sends datagrams as the lidars did that they were recorded from: to the same ports, and from the same addresses as
/// far as this host has them. One owner.
class PacketSender {
 public:
  /// `interface`: that multicast leaves by; empty: as routed. Throws Failure.
  PacketSender(const std::string& to, std::string interface);
  ~PacketSender();
  PacketSender(const PacketSender&) = delete;
  PacketSender& operator=(const PacketSender&) = delete;

  /// The clocks in data and position packets are moved by `shift`. Throws Failure.
  void send(const Datagram& datagram, Duration shift);

  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  /// Whether some left from another address than they were recorded from.
  [[nodiscard]] bool changed_sender() const { return changed_sender_; }

 private:
  int socket_for(std::uint32_t source_ip);

  std::uint32_t to_; ///< host byte order
  std::string interface_;
  std::map<std::uint32_t, int> sockets_; ///< by the address recorded
  std::array<std::byte, 2048> buffer_{};
  std::uint64_t sent_ = 0;
  bool changed_sender_ = false;
};

} // namespace locus::tools
