// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace locus::tools {

/// The definition of a message of ROS 2 ("nav_msgs/msg/Odometry") with those of all that is in it, as rosbag2 puts it
/// into MCAP (ros2msg): each behind a line of = and its name. Precondition: a type that locusd writes.
std::string ros2_definition(std::string_view type);

} // namespace locus::tools
