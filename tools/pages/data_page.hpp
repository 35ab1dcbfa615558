// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include <nlohmann/json.hpp>

namespace locus::tools {

/// Writes a page that is built into the program (locus_page() in CMake) with `data` in place of @DATA@, a script
/// element that holds JSON. Throws Failure.
void write_data_page(const std::filesystem::path& path, std::string_view page, const nlohmann::ordered_json& data);

} // namespace locus::tools
