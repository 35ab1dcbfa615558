// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"
#include "daemon/descriptor.hpp"
#include "drivers/net/socket_address.hpp"

namespace locus::tools {

/// A TCP connection to somebody who may be slow, silent or no lidar at all: every wait ends at the deadline that it was
/// opened with. An error is the reason in words, e.g. "Connection refused". One owner.
class TcpClient {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  static Expected<TcpClient, std::string> connect(const SocketAddress& to, Deadline deadline);

  /// Sends all of it, or says why not.
  std::optional<std::string> send(std::string_view text);

  /// Puts into `answer` what comes until `is_whole` says so of all that came, or the other end has no more: the caller
  /// looks which. Or says why not, such as that there would be more than `most` bytes.
  std::optional<std::string> receive(std::string& answer, std::size_t most,
                                     const std::function<bool(std::string_view)>& is_whole);

 private:
  TcpClient(daemon::Descriptor socket, Deadline deadline) : socket_(std::move(socket)), deadline_(deadline) {}
  [[nodiscard]] std::optional<std::string> wait_for(short events) const;

  daemon::Descriptor socket_; ///< does not wait by itself
  Deadline deadline_;
};

} // namespace locus::tools
