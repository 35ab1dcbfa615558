// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "config/config.hpp"
#include "daemon/dds/dds_node.hpp"

namespace locus::daemon {

/// A node of ROS 2, whose full name is namespace and name.
struct RosNode {
  std::string name_space; ///< "/" or "/robot_7"
  std::string name;
};

/// The node of a service whose topics have this prefix, in the namespace that the prefix lies in: locusd, and of an
/// instance locusd_INSTANCE, where what no name of ROS 2 may hold is written as _x and two hexadecimal digits. Two
/// instances never have the same.
RosNode ros_node(std::string_view prefix, std::string_view instance);

/// Tells ROS 2 that all endpoints which `from` has by now are those of the node, for as long as what is returned lives:
/// `ros2 node list` and `ros2 node info` show it. To be called again when there are more. Never waits; one that DDS
/// does not allow (DDS Security) tells nobody.
DdsEntity announce(const RosNode& node, const DdsNode& from, RosGraph graph);

} // namespace locus::daemon
