// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <ctime>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <poll.h>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/descriptor.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// What to answer to the head of an HTTP request, which may be any bytes: `metrics()` to GET /metrics, else why not.
/// The whole answer, after which the connection is closed. Any thread.
std::string http_answer(std::string_view request, const std::function<std::string()>& metrics);

/// Gives metrics by HTTP to all who reach its socket, and nothing else.
///
/// Nobody is waited for: a client has kPatience for all it does, is read kMaxRequestBytes of, and is answered once. Of
/// more than kMaxClients the one goes that came first. One owner, the main thread.
class MetricsServer {
 public:
  static constexpr std::size_t kMaxClients = 16, kMaxRequestBytes = 4096;
  static constexpr Duration kPatience = std::chrono::seconds{5};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  /// `listen` as parse_socket_address() takes it; the port is closed and the socket's file removed with the object.
  /// Fails with one line for the user.
  static Expected<std::unique_ptr<MetricsServer>, std::string> open(
      const std::string& listen, std::function<std::string()> metrics,
      Clock clock = [](clockid_t id) { return read_clock(id); });
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

  void add_to(std::vector<pollfd>& poll) const;
  /// Takes and gives what can be, without waiting. Whether anybody called or hung up.
  bool serve();

 private:
  struct Client {
    Descriptor socket;
    Duration came{};
    std::string request, answer; ///< so far; what is left
  };

  MetricsServer(Descriptor listener, std::filesystem::path path, std::function<std::string()> metrics, Clock clock)
      : listener_(std::move(listener)), path_(std::move(path)), metrics_(std::move(metrics)), clock_(clock) {}
  /// Whether the client stays.
  bool serve(Client& client);
  bool read_request(Client& client);
  const std::string& metrics_of_this_round();

  Descriptor listener_;
  std::filesystem::path path_; ///< of a Unix socket; else empty
  std::function<std::string()> metrics_;
  Clock clock_;
  std::string round_; ///< the metrics, once somebody has asked in this round
  std::vector<Client> clients_;
};

} // namespace locus::daemon
