// SPDX-License-Identifier: Apache-2.0
#include "drivers/net/socket_address.hpp"

#include <charconv>
#include <cstdint>
#include <cstring>
#include <string>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/un.h>

namespace locus {
namespace {

template <class Address> SocketAddress as_storage(const Address& address) {
  SocketAddress result;
  std::memcpy(&result.storage, &address, sizeof(address));
  result.size = sizeof(address);
  return result;
}

std::optional<std::uint16_t> parse_port(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size() || port == 0)
    return std::nullopt;
  return port;
}

std::optional<SocketAddress> parse_path(std::string_view path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path) || path.ends_with('/') || path.find('\0') != std::string_view::npos)
    return std::nullopt;
  path.copy(address.sun_path, path.size());
  return as_storage(address);
}

} // namespace

std::optional<SocketAddress> parse_socket_address(std::string_view text) {
  if (text.starts_with('/'))
    return parse_path(text);
  const std::size_t colon = text.rfind(':');
  const auto port = colon == std::string_view::npos ? std::nullopt : parse_port(text.substr(colon + 1));
  if (!port)
    return std::nullopt;
  const std::string host{text.substr(0, colon)};
  sockaddr_in ipv4{};
  ipv4.sin_family = AF_INET;
  ipv4.sin_port = htons(*port);
  if (inet_pton(AF_INET, host.c_str(), &ipv4.sin_addr) == 1)
    return as_storage(ipv4);
  sockaddr_in6 ipv6{};
  ipv6.sin6_family = AF_INET6;
  ipv6.sin6_port = htons(*port);
  const bool in_brackets = host.starts_with('[') && host.ends_with(']');
  if (in_brackets && inet_pton(AF_INET6, host.substr(1, host.size() - 2).c_str(), &ipv6.sin6_addr) == 1)
    return as_storage(ipv6);
  return std::nullopt;
}

} // namespace locus
