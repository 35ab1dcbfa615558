// SPDX-License-Identifier: Apache-2.0
#include "fetch/tcp_client.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

namespace locus::tools {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

} // namespace

Expected<TcpClient, std::string> TcpClient::connect(const SocketAddress& to, Deadline deadline) {
  TcpClient client{daemon::Descriptor{::socket(to.storage.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)},
                   deadline};
  const int socket = client.socket_.number();
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&to.storage), to.size) == 0)
    return {std::move(client)};
  if (errno != EINPROGRESS)
    return reason(errno);
  if (const auto problem = client.wait_for(POLLOUT))
    return *problem;
  int error = 0;
  socklen_t size = sizeof(error);
  getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size);
  return error == 0 ? Expected<TcpClient, std::string>{std::move(client)} : reason(error);
}

std::optional<std::string> TcpClient::send(std::string_view text) {
  while (!text.empty()) {
    if (auto problem = wait_for(POLLOUT))
      return problem;
    const ssize_t sent = ::send(socket_.number(), text.data(), text.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EAGAIN && errno != EINTR)
      return reason(errno);
    text.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(sent, 0)));
  }
  return std::nullopt;
}

std::optional<std::string> TcpClient::receive(std::string& answer, std::size_t most,
                                              const std::function<bool(std::string_view)>& is_whole) {
  answer.clear();
  std::array<char, 4096> piece;
  while (!is_whole(answer)) {
    if (auto problem = wait_for(POLLIN))
      return problem;
    const ssize_t size = recv(socket_.number(), piece.data(), piece.size(), 0);
    if (size < 0 && errno != EAGAIN && errno != EINTR)
      return reason(errno);
    if (size == 0)
      break;
    answer.append(piece.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    if (answer.size() > most)
      return fmt::format("the answer is longer than {} bytes", most);
  }
  return std::nullopt;
}

/// Waits for one of these events; returns the reason if it cannot.
std::optional<std::string> TcpClient::wait_for(short events) const {
  pollfd waiting{socket_.number(), events, 0};
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline_ - std::chrono::steady_clock::now());
    const int ready = left.count() > 0 ? poll(&waiting, 1, static_cast<int>(left.count())) : 0;
    if (ready > 0)
      return std::nullopt;
    if (ready == 0)
      return "no answer in time";
    if (errno != EINTR)
      return reason(errno);
  }
}

} // namespace locus::tools
