// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "support/patience.hpp"

namespace locus::test {

/// Receives the notifications of the service in place of systemd.
class NotifySocket {
 public:
  explicit NotifySocket(const std::filesystem::path& path) : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    const timeval poll{0, 100'000};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &poll, sizeof(poll));
    setenv("NOTIFY_SOCKET", path.c_str(), 1); // NOLINT(concurrency-mt-unsafe): before the program is started
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET"); // NOLINT(concurrency-mt-unsafe)
    close(socket_);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  /// Waits for a message with this word; discards all messages before it.
  bool hears(const std::string& word, Duration within = patience()) {
    const auto give_up = std::chrono::steady_clock::now() + within;
    while (std::chrono::steady_clock::now() < give_up) {
      std::array<char, 4096> text{};
      const ssize_t size = recv(socket_, text.data(), text.size(), 0);
      if (size > 0 && std::string(text.data(), static_cast<std::size_t>(size)).find(word) != std::string::npos)
        return true;
    }
    return false;
  }

 private:
  int socket_;
};

} // namespace locus::test
