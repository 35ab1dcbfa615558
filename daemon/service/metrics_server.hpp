// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <poll.h>

#include "core/base/expected.hpp"
#include "daemon/http_server.hpp"

namespace locus::daemon {

/// Answers the head of an HTTP request of arbitrary bytes: `metrics()` for GET /metrics, otherwise an error. Returns
/// the complete response, after which the connection is to be closed. Any thread.
std::string metrics_answer(std::string_view request, const std::function<std::string()>& metrics);

/// Serves the metrics over HTTP, without authentication; see HttpServer. One owner, the main thread.
class MetricsServer {
 public:
  /// Listens on `listen`, in the syntax of parse_socket_address(). Fails with one line for the user.
  static Expected<std::unique_ptr<MetricsServer>, std::string> open(
      const std::string& listen, std::function<std::string()> metrics,
      HttpServer::Clock clock = [](clockid_t id) { return read_clock(id); });

  void add_to(std::vector<pollfd>& poll) const { server_->add_to(poll); }
  /// See HttpServer::serve(). All requests of a call receive the same metrics.
  bool serve() {
    cache_.clear();
    return server_->serve();
  }

 private:
  explicit MetricsServer(std::function<std::string()> metrics) : metrics_(std::move(metrics)) {}
  const std::string& cached_metrics();

  std::function<std::string()> metrics_;
  std::string cache_; ///< metrics of this call of serve(); empty until requested
  std::unique_ptr<HttpServer> server_;
};

} // namespace locus::daemon
