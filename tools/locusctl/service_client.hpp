// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::tools {

/// Response of a running service.
struct ServiceAnswer {
  nlohmann::ordered_json json;
  std::vector<std::byte> bytes; ///< received in a memory file
};

/// Connection to a running service; see daemon::ControlServer. One owner.
class ServiceConnection {
 public:
  /// Throws Failure if there is no service.
  explicit ServiceConnection(const std::filesystem::path& socket);
  ~ServiceConnection();
  ServiceConnection(const ServiceConnection&) = delete;
  ServiceConnection& operator=(const ServiceConnection&) = delete;

  /// Sends a request and returns the answer. Throws Failure on a timeout of a few seconds, or if the service refuses;
  /// after a timeout the connection is of no further use.
  [[nodiscard]] ServiceAnswer request(const nlohmann::ordered_json& request) const;

 private:
  /// Returns the text, and the descriptor received with it or -1.
  [[nodiscard]] std::pair<std::string, int> receive() const;

  int socket_;
};

/// Sends one request over a connection of its own. Throws Failure.
ServiceAnswer send_request(const std::filesystem::path& socket, const nlohmann::ordered_json& request);

} // namespace locus::tools
