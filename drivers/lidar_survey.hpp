// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/ingest/lidar_packet.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/ouster/packet_format.hpp"
#include "drivers/sensor_time.hpp"
#include "drivers/unknown_packets.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {

/// A sender of lidar packets, as its packets tell.
struct HeardLidar {
  std::uint32_t ip = 0; ///< host byte order
  std::uint16_t port = 0;
  std::string_view model;              ///< of a Velodyne or a Hesai; empty: no packet could be read
  std::optional<std::uint64_t> ouster; ///< serial number of an Ouster, 0 where its packets say none
  std::size_t beams = 0;               ///< of an Ouster
  std::size_t columns_per_turn = 0;    ///< of an Ouster; 0 where it was not heard for two turns
  std::string_view return_mode;        ///< of one with a model
  double rotation_rate_rpm = 0, packets_per_s = 0;
  std::optional<velodyne::PpsState> pps; ///< of a Velodyne; none: no position packet came
  std::optional<TimeScale> clock;        ///< of an Ouster or a Hesai
  std::optional<UnknownPackets> unknown_packets;

  [[nodiscard]] bool is_known() const { return !model.empty() || ouster; }
  /// Velodyne's tell it by position packets, the others by the time in their own.
  [[nodiscard]] bool is_synchronised() const {
    return clock ? *clock != TimeScale::free_running : pps == velodyne::PpsState::locked;
  }
  /// "PPS locked", "clock UTC".
  [[nodiscard]] std::string clock_state() const;

  /// "VLP-16 at 192.168.1.201", "Ouster 122201000998 at 192.168.1.202".
  [[nodiscard]] std::string name() const;
};

/// Which lidars send, told from the datagrams that were overheard. One owner.
class LidarSurvey {
 public:
  static constexpr std::size_t kMaxSenders = 64; ///< more are no robot's, and not told

  void take(const Datagram& datagram);
  /// By address and port.
  [[nodiscard]] std::vector<HeardLidar> lidars() const;

 private:
  /// The mode of an Ouster, which no field of its packets tells, but their times do.
  struct OusterMode {
    struct Turn {
      std::uint16_t frame_id;
      Duration begin;
    };
    std::optional<std::uint16_t> frame_id; ///< of the latest packet
    std::optional<Turn> first, last;       ///< whose begin was heard
    Duration column{};                     ///< from one to the next

    void take(const ouster::PacketFormat& format, std::span<const std::byte> packet);
    [[nodiscard]] double turns_per_s() const; ///< 0 before the third begin of a turn
    [[nodiscard]] std::size_t columns_per_turn() const;
  };
  struct Sender {
    velodyne::Decoder velodyne;
    hesai::Decoder hesai;
    LidarPacket packet;
    std::optional<std::uint64_t> ouster; ///< HeardLidar::ouster
    std::size_t beams = 0;
    OusterMode mode;
    TimeScale clock{}; ///< of an Ouster or a Hesai
    UnknownPackets unknown_hesai;
    std::uint64_t packets = 0; ///< that could be read, or are an Ouster's columns
    Stamp first, last;

    bool read(const Datagram& datagram);
    void read_ouster(const ouster::PacketFormat& format, const Datagram& datagram);
  };

  std::map<std::pair<std::uint32_t, std::uint16_t>, std::unique_ptr<Sender>> senders_; ///< by address and port
  std::map<std::uint32_t, velodyne::PpsState> pps_;                                    ///< by address
};

} // namespace locus
