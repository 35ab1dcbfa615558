// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/input.hpp"
#include "drivers/lidar_router.hpp"
#include "locus_replay/mcap_messages.hpp"

namespace locus::tools {

/// Writes the inputs of a run as received, so that the file replays to the same bits with the same configuration:
/// samples of the motion sources, and packets or clouds of the lidars; before the first of each lidar and IMU its
/// mounting on /tf_static. One owner.
///
/// | input | topic | type |
/// |---|---|---|
/// | motion source | as configured, else /NAME | Imu, Odometry |
/// | clouds | as configured | PointCloud2 |
/// | packets of an Ouster | /NAME/lidar_packets, /NAME/imu_packets; /NAME/metadata | PacketMsg; String |
/// | packets of other lidars | /NAME/packets | NebulaPackets, of a tenth of a second |
///
/// NebulaPackets is the only one of the types of packets that holds those of any maker and length: a VelodyneScan has
/// no room for position packets, by which the replay recognises the lidar's clock.
///
/// Left out are packets that no lidar accepts, such as those of another sender, and the points of KITTI's raw data,
/// which are neither packets nor clouds.
class McapInputs {
 public:
  /// Both must outlive this.
  McapInputs(McapMessages& messages, const Config& config);

  /// Writes an input after it was processed by `lidars`.
  void add(const daemon::Input& input, const LidarRouter& lidars);

 private:
  /// Topic that is added to the file with its first message.
  struct Topic {
    std::string name;
    std::optional<std::uint16_t> channel{};
  };
  struct Lidar {
    Topic packets;               ///< or clouds
    Topic imu_packets, metadata; ///< of an Ouster
    struct Packet {
      Stamp stamp;
      std::size_t bytes;
    };
    std::vector<Packet> waiting{};     ///< not written yet
    std::vector<std::byte> payloads{}; ///< of these, one behind the other
  };

  template <class Message> void write(Topic& topic, Stamp stamp, const Message& message);
  void add_datagram(const Datagram& datagram, const LidarRouter& lidars);
  void add_packet(const Datagram& datagram, std::size_t index);
  void add_ouster_packet(const Datagram& datagram, std::size_t index);
  void add_cloud(const daemon::CloudInput& cloud);
  void add_imu(const daemon::ImuInput& imu);
  void add_odometry(const daemon::OdometryInput& odometry);
  void write_waiting(std::size_t index);
  void write_mounting(Stamp stamp, const std::string& frame, const Pose& T_base_sensor);

  McapMessages& messages_;
  const Config& config_;
  daemon::FrameNames frames_;
  Topic static_tf_{"/tf_static"};
  std::vector<Lidar> lidars_;  ///< by configuration index
  std::vector<Topic> sources_; ///< by configuration index
};

} // namespace locus::tools
