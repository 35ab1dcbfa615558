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

/// TCP connection to a peer that may be slow, silent or no lidar: every wait ends at the deadline given at
/// construction. An error is its reason in words, e.g. "Connection refused". One owner.
class TcpClient {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  static Expected<TcpClient, std::string> connect(const SocketAddress& to, Deadline deadline);

  /// Sends all of the text, or returns the error.
  std::optional<std::string> send(std::string_view text);

  /// Reads into `answer` until `is_whole` accepts all that was received or the peer closes; the caller distinguishes
  /// these. Returns the error otherwise, such as more than `most` bytes.
  std::optional<std::string> receive(std::string& answer, std::size_t most,
                                     const std::function<bool(std::string_view)>& is_whole);

 private:
  TcpClient(daemon::Descriptor socket, Deadline deadline) : socket_(std::move(socket)), deadline_(deadline) {}
  [[nodiscard]] std::optional<std::string> wait_for(short events) const;

  daemon::Descriptor socket_; ///< non-blocking
  Deadline deadline_;
};

} // namespace locus::tools
