// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <sys/socket.h>

namespace locus {

/// Where a stream socket listens, as bind() takes it.
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
};

/// From 127.0.0.1:9464, [::1]:9464 or the absolute path of a Unix socket; nothing for any other text. Numbers alone: a
/// name would have to be asked for. Any thread.
std::optional<SocketAddress> parse_socket_address(std::string_view text);

} // namespace locus
