// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

namespace locus::tools {

/// What a running service answered.
struct ServiceAnswer {
  nlohmann::ordered_json json;
  std::vector<std::byte> bytes; ///< that came along in a memory file
};

/// Asks a running service one thing; see daemon::ControlServer. Throws Failure when there is no service, it does not
/// answer within a few seconds, or it refuses.
ServiceAnswer ask(const std::filesystem::path& socket, const nlohmann::ordered_json& request);

} // namespace locus::tools
