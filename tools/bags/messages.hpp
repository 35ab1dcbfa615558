// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "bags/message_reader.hpp"
#include "core/base/stamp.hpp"
#include "daemon/dds/ros_types.hpp"
#include "drivers/velodyne/model.hpp"

/// The messages that are of use in a bag, from their bytes. What breaks off in their midst is none.
namespace locus::tools {

inline constexpr std::string_view kVelodyneScanType = "velodyne_msgs/VelodyneScan";
inline constexpr std::string_view kImuType = "sensor_msgs/Imu";
inline constexpr std::string_view kOdometryType = "nav_msgs/Odometry";

/// Data packets as the lidar sent them, each with the time at which the driver received it.
struct VelodyneScan {
  struct Packet {
    Stamp stamp;
    std::array<std::byte, velodyne::kDataPacketBytes> payload;
  };
  std::vector<Packet> packets;
};

/// The stamp of a header or packet, or `recorded` for one that nobody has set.
Stamp stamp_or(Stamp recorded, Stamp stamp);

/// All but the names of the frames, which stay null.
std::optional<daemon::ros::Imu> read_imu(MessageReader reader);
std::optional<daemon::ros::Odometry> read_odometry(MessageReader reader);
std::optional<VelodyneScan> read_velodyne_scan(MessageReader reader);

} // namespace locus::tools
