// SPDX-License-Identifier: Apache-2.0
#include "daemon/http_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <netinet/in.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "daemon/unix_socket.hpp"
#include "drivers/net/socket_address.hpp"

namespace locus::daemon {

namespace {

constexpr std::string_view kEndOfLine = "\r\n", kEndOfHead = "\r\n\r\n";

/// Removes the text up to the separator and the separator, and returns the text.
std::string_view split(std::string_view& text, std::string_view separator) {
  const std::string_view part = text.substr(0, text.find(separator));
  text.remove_prefix(std::min(text.size(), part.size() + separator.size()));
  return part;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const std::size_t begin = std::min(text.find_first_not_of(kBlank), text.size());
  return text.substr(begin, text.find_last_not_of(kBlank) + 1 - begin);
}

bool is_same_name(std::string_view a, std::string_view b) {
  return a.size() == b.size() && strncasecmp(a.data(), b.data(), a.size()) == 0;
}

/// Permits binding before the network interface is up, and while connections of the previous run are closing.
void set_options(const Descriptor& listener, int family) {
  const int yes = 1;
  setsockopt(listener.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  if (family == AF_INET6) {
    setsockopt(listener.number(), IPPROTO_IPV6, IPV6_V6ONLY, &yes, sizeof(yes));
    setsockopt(listener.number(), IPPROTO_IPV6, IPV6_FREEBIND, &yes, sizeof(yes));
  } else if (family == AF_INET) {
    setsockopt(listener.number(), IPPROTO_IP, IP_FREEBIND, &yes, sizeof(yes));
  }
}

} // namespace

std::optional<HttpRequest> HttpRequest::parse(std::string_view bytes) {
  const std::size_t end = bytes.find(kEndOfHead);
  if (end == std::string_view::npos)
    return std::nullopt;
  HttpRequest request;
  request.fields = bytes.substr(0, end + kEndOfLine.size());
  std::string_view line = split(request.fields, kEndOfLine);
  request.method = split(line, " ");
  request.query = split(line, " ");
  request.path = split(request.query, "?");
  if (request.path.empty() || !line.starts_with("HTTP/1."))
    return std::nullopt;
  return request;
}

std::optional<std::string_view> HttpRequest::field(std::string_view name) const {
  std::optional<std::string_view> found;
  for (std::string_view rest = fields; !rest.empty();) {
    std::string_view value = split(rest, kEndOfLine);
    if (!is_same_name(split(value, ":"), name))
      continue;
    if (found)
      return std::nullopt;
    found = trimmed(value);
  }
  return found;
}

std::string http_response(std::string_view status, std::string_view type, std::string_view fields,
                          std::string_view body) {
  return fmt::format("HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n{}", status,
                     type, body.size(), fields, body);
}

std::string http_error(std::string_view status, std::string_view why, std::string_view fields) {
  return http_response(status, "text/plain; charset=utf-8", fields, fmt::format("{}\n", why));
}

Expected<std::unique_ptr<HttpServer>, int> HttpServer::open(const std::string& listen, Handler handler, Clock clock) {
  const std::optional<SocketAddress> address = parse_socket_address(listen);
  if (!address)
    return EINVAL;
  const int family = address->storage.ss_family;
  const std::filesystem::path path = family == AF_UNIX ? listen : "";
  remove_if_left_behind(path, SOCK_STREAM);
  Descriptor listener{::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  set_options(listener, family);
  if (bind(listener.number(), reinterpret_cast<const sockaddr*>(&address->storage), address->size) != 0)
    return errno;
  constexpr mode_t kReadWriteForAll = 0666; // like the status, for any local user
  if ((!path.empty() && chmod(path.c_str(), kReadWriteForAll) != 0) || ::listen(listener.number(), kMaxClients) != 0)
    return errno;
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(listener), path, std::move(handler), clock));
}

HttpServer::~HttpServer() {
  std::error_code ignored;
  if (!path_.empty())
    std::filesystem::remove(path_, ignored);
}

void HttpServer::add_to(std::vector<pollfd>& poll) const {
  poll.push_back({listener_.number(), POLLIN, 0});
  for (const Client& client : clients_)
    poll.push_back({client.socket.number(), static_cast<short>(client.answer.empty() ? POLLIN : POLLOUT), 0});
}

/// Accepts clients. A request that is already there is answered at once and displaces no other client.
bool HttpServer::serve() {
  const std::size_t disconnected = std::erase_if(clients_, [this](Client& client) { return !serve(client); });
  for (std::size_t i = 0; i < kMaxClients; ++i) {
    Descriptor socket{accept4(listener_.number(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)};
    if (socket.number() < 0)
      return i > 0 || disconnected > 0 || accept_has_failed();
    Client client{std::move(socket), clock_(CLOCK_MONOTONIC), {}, {}};
    if (!serve(client))
      continue;
    if (clients_.size() == kMaxClients)
      clients_.erase(clients_.begin());
    clients_.push_back(std::move(client));
  }
  return true;
}

bool HttpServer::serve(Client& client) {
  if (clock_(CLOCK_MONOTONIC) - client.connected_at > kPatience)
    return false;
  if (client.answer.empty() && !read_request(client))
    return false;
  if (client.answer.empty())
    return true;
  const ssize_t sent =
      ::send(client.socket.number(), client.answer.data(), client.answer.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0)
    return errno == EAGAIN || errno == EINTR;
  client.answer.erase(0, static_cast<std::size_t>(sent));
  return !client.answer.empty();
}

/// Reads from a client and sets its answer once the request is complete; false if the client is to be disconnected.
bool HttpServer::read_request(Client& client) {
  std::array<char, kMaxRequestBytes> bytes{};
  const ssize_t size = recv(client.socket.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (size < 0)
    return errno == EAGAIN || errno == EINTR;
  if (size == 0)
    return false;
  client.request.append(bytes.data(), static_cast<std::size_t>(size));
  if (client.request.find(kEndOfHead) != std::string::npos || client.request.size() > kMaxRequestBytes)
    client.answer = handler_(client.request);
  return true;
}

} // namespace locus::daemon
