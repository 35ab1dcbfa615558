// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>

namespace locus::tools {

/// An entry below `lidars:` in the configuration, with these keys between its name and where it is on the robot, which
/// is to be measured.
inline std::string lidar_entry(std::string_view name, std::string_view keys) {
  return fmt::format("  - {{name: {}, {}, T_base_lidar: {{xyz_m: [0, 0, 0], rpy_deg: [0, 0, 0]}}}}\n", name, keys);
}

} // namespace locus::tools
