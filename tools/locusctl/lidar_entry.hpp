// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>

namespace locus::tools {

/// Formats an entry below `lidars:` in the configuration, with these keys between its name and its pose on the robot,
/// which the user has to measure.
inline std::string lidar_entry(std::string_view name, std::string_view keys) {
  return fmt::format("  - {{name: {}, {}, T_base_lidar: {{xyz_m: [0, 0, 0], rpy_deg: [0, 0, 0]}}}}\n", name, keys);
}

} // namespace locus::tools
