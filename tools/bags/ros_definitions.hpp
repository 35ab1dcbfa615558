// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace locus::tools {

/// Returns the definition of a ROS 2 message ("nav_msgs/msg/Odometry") and of all nested types, as rosbag2 stores it in
/// MCAP (ros2msg): each after a line of = and its name. Precondition: a type that locusd writes.
std::string ros2_definition(std::string_view type);

} // namespace locus::tools
