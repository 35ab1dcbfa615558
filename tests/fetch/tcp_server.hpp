// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace locus::test {

/// A reserved port of this host: connections are refused until a server listens.
class TcpPort {
 public:
  explicit TcpPort(const std::string& address = "127.0.0.1", std::uint16_t number = 0)
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = htons(number);
    inet_pton(AF_INET, address.c_str(), &own.sin_addr);
    const int yes = 1;
    setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    socklen_t size = sizeof(own);
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&own), size) != 0 ||
        getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size) != 0)
      throw std::runtime_error("no port " + std::to_string(number) + " of " + address);
    number_ = ntohs(own.sin_port);
  }
  ~TcpPort() { close(socket_); }
  TcpPort(const TcpPort&) = delete;
  TcpPort& operator=(const TcpPort&) = delete;

  [[nodiscard]] std::uint16_t number() const { return number_; }
  [[nodiscard]] int socket() const { return socket_; }

 private:
  int socket_;
  std::uint16_t number_ = 0;
};

/// Serves clients one after the other: sends `answer` of each piece of a request, or nothing if that is empty.
class TcpServer {
 public:
  using Answer = std::function<std::optional<std::string>(const std::string& question)>;
  struct Manners {
    std::size_t piece_bytes = 1 << 20; ///< bytes per send
    bool hangs_up = true;              ///< after an answer
  };

  TcpServer(TcpPort& port, Answer answer) : TcpServer(port, std::move(answer), Manners{}) {}
  TcpServer(TcpPort& port, Answer answer, Manners manners)
      : port_(port), answer_(std::move(answer)), manners_(manners) {
    listen(port_.socket(), 4);
    thread_ = std::thread{[this] {
      for (int caller = -1; (caller = accept(port_.socket(), nullptr, nullptr)) >= 0; close(caller))
        serve(caller);
    }};
  }
  ~TcpServer() {
    shutdown(port_.socket(), SHUT_RDWR);
    thread_.join();
  }
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

 private:
  void serve(int caller) const {
    std::array<char, 4096> question;
    for (ssize_t size = 0; (size = recv(caller, question.data(), question.size(), 0)) > 0;) {
      const auto answer = answer_(std::string(question.data(), static_cast<std::size_t>(size)));
      for (std::string_view left = answer ? *answer : std::string_view{}; !left.empty();) {
        const ssize_t sent = send(caller, left.data(), std::min(left.size(), manners_.piece_bytes), MSG_NOSIGNAL);
        if (sent < 0)
          return;
        left.remove_prefix(static_cast<std::size_t>(sent));
        if (!left.empty())
          std::this_thread::sleep_for(std::chrono::microseconds{200});
      }
      if (answer && manners_.hangs_up)
        return;
    }
  }

  TcpPort& port_;
  Answer answer_;
  Manners manners_;
  std::thread thread_;
};

} // namespace locus::test
