// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/config_proposal.hpp"

namespace locus::tools {

/// Configures the port of the first lidar for a capture file, by the first packets. Reports a port other than the
/// configured one in `lines` for the user, and the reasons with the other lidars in `reasons`. Leaves an Ouster to
/// find_metadata(). Does nothing for standard input, and without a lidar.
void configure_lidar_of_capture(const std::filesystem::path& file, Config& config, std::vector<std::string>& lines,
                                ConfigReasons& reasons);

} // namespace locus::tools
