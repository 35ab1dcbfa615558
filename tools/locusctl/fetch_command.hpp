// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace locus::tools {

/// Fetches the file that only the lidar at a numeric address has, and writes it to `file` atomically; without a name,
/// to a file in the current folder named after the address. Returns a description and the YAML to paste. Throws
/// Failure.
std::string fetch(const std::string& address, std::filesystem::path file);

} // namespace locus::tools
