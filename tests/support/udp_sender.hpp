// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace locus::test {

/// Sends datagrams over the loopback interface.
class UdpSender {
 public:
  /// `from_ip`: an address of this host, host byte order.
  explicit UdpSender(std::uint32_t from_ip = INADDR_ANY) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in from{};
    from.sin_family = AF_INET;
    from.sin_addr.s_addr = htonl(from_ip);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&from), sizeof(from)), 0);
    in_addr loopback{htonl(INADDR_LOOPBACK)};
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof(loopback));
    const int allowed = 1;
    setsockopt(socket_, SOL_SOCKET, SO_BROADCAST, &allowed, sizeof(allowed));
  }
  ~UdpSender() { close(socket_); }
  UdpSender(const UdpSender&) = delete;
  UdpSender& operator=(const UdpSender&) = delete;

  void send(std::uint16_t port, std::span<const std::byte> payload, std::uint32_t ip = INADDR_LOOPBACK) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(ip);
    EXPECT_EQ(sendto(socket_, payload.data(), payload.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof(to)),
              static_cast<ssize_t>(payload.size()));
  }

 private:
  int socket_;
};

} // namespace locus::test
