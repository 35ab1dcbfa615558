// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/metrics_server.hpp"

#include <array>
#include <cerrno>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "daemon/service/unix_socket.hpp"
#include "drivers/net/socket_address.hpp"

namespace locus::daemon {

namespace {

constexpr std::string_view kEndOfHead = "\r\n\r\n";

std::string http(std::string_view status, std::string_view type, std::string_view more, std::string_view body) {
  return fmt::format("HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n{}", status,
                     type, body.size(), more, body);
}

std::string http_refusal(std::string_view status, std::string_view why, std::string_view more = "") {
  return http(status, "text/plain; charset=utf-8", more, fmt::format("{}\n", why));
}

/// Removes the first word and the space after it, and returns the word.
std::string_view split_word(std::string_view& text) {
  const std::string_view word = text.substr(0, text.find(' '));
  text.remove_prefix(std::min(text.size(), word.size() + 1));
  return word;
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

std::string http_answer(std::string_view request, const std::function<std::string()>& metrics) {
  std::string_view line = request.substr(0, request.find("\r\n"));
  const std::string_view method = split_word(line), target = split_word(line);
  if (request.find(kEndOfHead) == std::string_view::npos || target.empty() || !line.starts_with("HTTP/1."))
    return http_refusal("400 Bad Request", "Send GET /metrics HTTP/1.1 and a short head.");
  if (target.substr(0, target.find('?')) != "/metrics")
    return http_refusal("404 Not Found", "The only resource is /metrics.");
  if (method != "GET" && method != "HEAD")
    return http_refusal("405 Method Not Allowed", "The only methods are GET and HEAD.", "Allow: GET, HEAD\r\n");
  std::string answer = http("200 OK", "application/openmetrics-text; version=1.0.0; charset=utf-8", "", metrics());
  if (method == "HEAD")
    answer.resize(answer.find(kEndOfHead) + kEndOfHead.size());
  return answer;
}

Expected<std::unique_ptr<MetricsServer>, std::string>
MetricsServer::open(const std::string& listen, std::function<std::string()> metrics, Clock clock) {
  const auto failed = [&](int error) {
    return fmt::format("metrics.listen {}: {}; the service runs without metrics: set another address, and reload",
                       listen, std::generic_category().message(error));
  };
  const std::optional<SocketAddress> address = parse_socket_address(listen);
  if (!address)
    return failed(EINVAL);
  const int family = address->storage.ss_family;
  const std::filesystem::path path = family == AF_UNIX ? listen : "";
  remove_if_left_behind(path, SOCK_STREAM);
  Descriptor listener{::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  set_options(listener, family);
  if (bind(listener.number(), reinterpret_cast<const sockaddr*>(&address->storage), address->size) != 0)
    return failed(errno);
  constexpr mode_t kReadWriteForAll = 0666; // like the status, for any local user
  if ((!path.empty() && chmod(path.c_str(), kReadWriteForAll) != 0) || ::listen(listener.number(), kMaxClients) != 0)
    return failed(errno);
  return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(listener), path, std::move(metrics), clock));
}

MetricsServer::~MetricsServer() {
  std::error_code ignored;
  if (!path_.empty())
    std::filesystem::remove(path_, ignored);
}

void MetricsServer::add_to(std::vector<pollfd>& poll) const {
  poll.push_back({listener_.number(), POLLIN, 0});
  for (const Client& client : clients_)
    poll.push_back({client.socket.number(), static_cast<short>(client.answer.empty() ? POLLIN : POLLOUT), 0});
}

/// Accepts clients. A request that is already there is answered at once and displaces no other client.
bool MetricsServer::serve() {
  cache_.clear();
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

bool MetricsServer::serve(Client& client) {
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
bool MetricsServer::read_request(Client& client) {
  std::array<char, kMaxRequestBytes> bytes{};
  const ssize_t size = recv(client.socket.number(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (size < 0)
    return errno == EAGAIN || errno == EINTR;
  if (size == 0)
    return false;
  client.request.append(bytes.data(), static_cast<std::size_t>(size));
  if (client.request.find(kEndOfHead) != std::string::npos || client.request.size() > kMaxRequestBytes)
    client.answer = http_answer(client.request, [this] { return cached_metrics(); });
  return true;
}

const std::string& MetricsServer::cached_metrics() {
  if (cache_.empty())
    cache_ = metrics_();
  return cache_;
}

} // namespace locus::daemon
