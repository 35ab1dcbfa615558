// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

namespace locus::experiments {

/// Writes results as one page that needs no network and no other file. Throws tools::Failure.
void write_page(const std::filesystem::path& path, const nlohmann::ordered_json& results);

} // namespace locus::experiments
