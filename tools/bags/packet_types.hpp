// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "daemon/dds/ros_types.hpp"
#include "packet_types.h"

/// Short names of the ROS 2 messages in which lidar packets are recorded.
namespace locus::daemon::ros {

using String = std_msgs_msg_dds__String_;
using NebulaPacket = nebula_msgs_msg_dds__NebulaPacket_;
using NebulaPackets = nebula_msgs_msg_dds__NebulaPackets_;
using OusterPacket = ouster_sensor_msgs_msg_dds__PacketMsg_;

// Only in files, where a hash is optional.
template <> inline Type type_of<String>() { return {&std_msgs_msg_dds__String__desc, ""}; }
template <> inline Type type_of<NebulaPackets>() { return {&nebula_msgs_msg_dds__NebulaPackets__desc, ""}; }
template <> inline Type type_of<OusterPacket>() { return {&ouster_sensor_msgs_msg_dds__PacketMsg__desc, ""}; }

} // namespace locus::daemon::ros
