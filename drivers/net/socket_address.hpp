// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <sys/socket.h>

namespace locus {

/// Listening address of a stream socket, as passed to bind().
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
};

/// Parses 127.0.0.1:9464, [::1]:9464 or the absolute path of a Unix socket; empty for any other text. Numeric addresses
/// only, since names would need a lookup. Thread-safe.
std::optional<SocketAddress> parse_socket_address(std::string_view text);

} // namespace locus
