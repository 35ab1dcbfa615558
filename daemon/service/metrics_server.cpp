// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/metrics_server.hpp"

#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace locus::daemon {

std::string metrics_answer(std::string_view request, const std::function<std::string()>& metrics) {
  const std::optional<HttpRequest> head = HttpRequest::parse(request);
  if (!head)
    return http_error("400 Bad Request", "Send GET /metrics HTTP/1.1 and a short head.");
  if (head->path != "/metrics")
    return http_error("404 Not Found", "The only resource is /metrics.");
  if (head->method != "GET" && head->method != "HEAD")
    return http_error("405 Method Not Allowed", "The only methods are GET and HEAD.", "Allow: GET, HEAD\r\n");
  const std::string body = metrics();
  std::string answer = http_response("200 OK", "application/openmetrics-text; version=1.0.0; charset=utf-8", "", body);
  if (head->method == "HEAD")
    answer.resize(answer.size() - body.size());
  return answer;
}

Expected<std::unique_ptr<MetricsServer>, std::string>
MetricsServer::open(const std::string& listen, std::function<std::string()> metrics, HttpServer::Clock clock) {
  std::unique_ptr<MetricsServer> served(new MetricsServer(std::move(metrics)));
  const auto answer = [self = served.get()](std::string_view request) {
    return metrics_answer(request, [self] { return self->cached_metrics(); });
  };
  auto server = HttpServer::open(listen, answer, clock);
  if (!server)
    return fmt::format("metrics.listen {}: {}; the service runs without metrics: set another address, and reload",
                       listen, std::generic_category().message(server.error()));
  served->server_ = std::move(*server);
  return served;
}

const std::string& MetricsServer::cached_metrics() {
  if (cache_.empty())
    cache_ = metrics_();
  return cache_;
}

} // namespace locus::daemon
