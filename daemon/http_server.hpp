// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <ctime>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <poll.h>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "daemon/descriptor.hpp"
#include "daemon/machine_time.hpp"

namespace locus::daemon {

/// Head of an HTTP request; views into its bytes.
struct HttpRequest {
  std::string_view method, path, query; ///< `query` without its question mark
  std::string_view fields;              ///< lines of the header, each ended by CR LF

  /// Parses arbitrary bytes; empty for anything but a complete head of HTTP/1.
  static std::optional<HttpRequest> parse(std::string_view bytes);

  /// Returns the value of a field by its name in any case; empty if it is missing or occurs more than once.
  [[nodiscard]] std::optional<std::string_view> field(std::string_view name) const;
};

/// Returns a complete response, after which the connection is closed. `fields`: further lines, each ended by CR LF.
std::string http_response(std::string_view status, std::string_view type, std::string_view fields,
                          std::string_view body);

/// Returns a response that explains an error in one line.
std::string http_error(std::string_view status, std::string_view why, std::string_view fields = "");

/// Serves short responses over HTTP/1.1, one per connection.
///
/// Never blocks on a client: each has kPatience in total, kMaxRequestBytes of request and one response. Above
/// kMaxClients the oldest connection is dropped. One owner.
class HttpServer {
 public:
  static constexpr std::size_t kMaxClients = 16;
  static constexpr std::size_t kMaxRequestBytes = 16'384; ///< a browser sends the cookies of all ports of a host
  static constexpr Duration kPatience = std::chrono::seconds{5};

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  /// Callback that answers the head of a request, of arbitrary bytes, by a complete response.
  using Handler = std::function<std::string(std::string_view request)>;

  /// Listens on `listen`, in the syntax of parse_socket_address(). The destructor closes the port and removes
  /// the socket's file. Fails with the error of the system.
  static Expected<std::unique_ptr<HttpServer>, int> open(
      const std::string& listen, Handler handler, Clock clock = [](clockid_t id) { return read_clock(id); });
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  void add_to(std::vector<pollfd>& poll) const;
  /// Reads requests and sends responses without waiting. True if a client connected or disconnected.
  bool serve();

 private:
  struct Client {
    Descriptor socket;
    Duration connected_at{};
    std::string request, answer; ///< received so far; still to be sent
  };

  HttpServer(Descriptor listener, std::filesystem::path path, Handler handler, Clock clock)
      : listener_(std::move(listener)), path_(std::move(path)), handler_(std::move(handler)), clock_(clock) {}
  /// Serves a client; false if it is to be disconnected.
  bool serve(Client& client);
  bool read_request(Client& client);

  Descriptor listener_;
  std::filesystem::path path_; ///< Unix socket; otherwise empty
  Handler handler_;
  Clock clock_;
  std::vector<Client> clients_;
};

} // namespace locus::daemon
