// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "config/config.hpp"
#include "daemon/dds/dds_node.hpp"

namespace locus::daemon {

/// ROS 2 node; its full name consists of namespace and name.
struct RosNode {
  std::string name_space; ///< "/" or "/robot_7"
  std::string name;
};

/// Returns the node of a service whose topics have this prefix, in the parent namespace of the prefix: locusd, or
/// locusd_INSTANCE for an instance, with characters that are invalid in ROS 2 names escaped as _x and two hexadecimal
/// digits. Unique per instance.
RosNode ros_node(std::string_view prefix, std::string_view instance);

/// Announces to ROS 2 that all current endpoints of `from` belong to the node, for the lifetime of the returned entity,
/// so that `ros2 node list` and `ros2 node info` show it. To be called again after new endpoints. Does not wait; has no
/// effect if DDS Security forbids it.
DdsEntity announce(const RosNode& node, const DdsNode& from, RosGraph graph);

} // namespace locus::daemon
