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

/// Answers the head of an HTTP request of arbitrary bytes: `metrics()` for GET /metrics, otherwise an error. Returns
/// the complete response, after which the connection is to be closed. Any thread.
std::string http_answer(std::string_view request, const std::function<std::string()>& metrics);

/// Serves the metrics over HTTP, without authentication.
///
/// Never blocks on a client: each has kPatience in total, kMaxRequestBytes of request and one response. Above
/// kMaxClients the oldest connection is dropped. One owner, the main thread.
class MetricsServer {
 public:
  static constexpr std::size_t kMaxClients = 16, kMaxRequestBytes = 4096;
  static constexpr Duration kPatience = std::chrono::seconds{5};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  /// Listens on `listen`, in the syntax of parse_socket_address(). The destructor closes the port and removes the
  /// socket's file. Fails with one line for the user.
  static Expected<std::unique_ptr<MetricsServer>, std::string> open(
      const std::string& listen, std::function<std::string()> metrics,
      Clock clock = [](clockid_t id) { return read_clock(id); });
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

  void add_to(std::vector<pollfd>& poll) const;
  /// Reads requests and sends responses without waiting. True if a client connected or disconnected.
  bool serve();

 private:
  struct Client {
    Descriptor socket;
    Duration connected_at{};
    std::string request, answer; ///< received so far; still to be sent
  };

  MetricsServer(Descriptor listener, std::filesystem::path path, std::function<std::string()> metrics, Clock clock)
      : listener_(std::move(listener)), path_(std::move(path)), metrics_(std::move(metrics)), clock_(clock) {}
  /// Serves a client; false if it is to be disconnected.
  bool serve(Client& client);
  bool read_request(Client& client);
  const std::string& cached_metrics();

  Descriptor listener_;
  std::filesystem::path path_; ///< Unix socket; otherwise empty
  std::function<std::string()> metrics_;
  Clock clock_;
  std::string cache_; ///< metrics cached for this round; empty until requested
  std::vector<Client> clients_;
};

} // namespace locus::daemon
