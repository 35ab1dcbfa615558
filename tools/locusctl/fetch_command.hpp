// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace locus::tools {

/// Fetches what only the lidar at a numeric address has, and writes it to `file`: whole or not at all. Without a file
/// it is named after the address and put in the current folder. Gives what was fetched, and the YAML to paste. Throws
/// Failure.
std::string fetch(const std::string& address, std::filesystem::path file);

} // namespace locus::tools
