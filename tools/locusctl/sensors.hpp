// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "config/config.hpp"
#include "core/base/stamp.hpp"

namespace locus::tools {

/// Listens to the lidars on all networks, and to the topics of ROS 2 on that of `dds`. Formats a comment for each lidar
/// and the configuration that fits, YAML with the reason for each line. Throws Failure if there is no lidar.
std::string find_sensors(const DdsOptions& dds, Duration duration);

} // namespace locus::tools
