// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <ctime>
#include <stdexcept>
#include <thread>
#include <utility>

#include "drivers/net/udp_socket.hpp"
#include "support/temporary_file.hpp"
#include "support/udp_sender.hpp"

namespace locus::test {

/// Keeps kernel receive timestamps enabled. The kernel enables them asynchronously after the first socket requests
/// them; until then datagrams are stamped when they are read.
class KernelStamps {
 public:
  KernelStamps() : socket_(open()) {
    constexpr int kAttempts = 1000;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      sender_.send(socket_.port(), bytes_of("is it on?"));
      timespec sent{};
      clock_gettime(CLOCK_REALTIME, &sent);
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
      const auto datagrams = socket_.receive();
      if (!datagrams.empty() &&
          datagrams.back().receive_stamp <= Stamp{std::chrono::seconds{sent.tv_sec} + Duration{sent.tv_nsec}})
        return;
    }
    throw std::runtime_error("the kernel stamps no datagrams");
  }

 private:
  static UdpSocket open() {
    constexpr std::uint16_t kAnyPort = 0;
    auto socket = UdpSocket::open(kAnyPort);
    if (!socket)
      throw std::runtime_error(socket.error());
    return std::move(*socket);
  }

  UdpSocket socket_;
  UdpSender sender_;
};

} // namespace locus::test
