// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::tools {

/// Response of a running service.
struct ServiceAnswer {
  nlohmann::ordered_json json;
  std::vector<std::byte> bytes; ///< received in a memory file
};

/// Sends one request to a running service; see daemon::ControlServer. Throws Failure if there is no service, on a
/// timeout of a few seconds, or if it refuses.
ServiceAnswer send_request(const std::filesystem::path& socket, const nlohmann::ordered_json& request);

} // namespace locus::tools
