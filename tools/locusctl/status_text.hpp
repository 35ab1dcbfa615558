// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace locus::tools {

/// The status of a service for human eyes: fits 80 x 24 with three lidars and four motion sources.
std::string status_text(const nlohmann::ordered_json& status);

} // namespace locus::tools
