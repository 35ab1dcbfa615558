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

/// Sender of lidar packets, as described by its packets.
struct SurveyedLidar {
  std::uint32_t ip = 0; ///< host byte order
  std::uint16_t port = 0;
  std::string_view model;              ///< Velodyne or Hesai; empty: no packet could be decoded
  std::optional<std::uint64_t> ouster; ///< serial number of an Ouster, 0 if its packets carry none
  std::size_t beams = 0;               ///< Ouster only; 0 if packets of several models have this length
  std::size_t columns_per_turn = 0;    ///< Ouster only; 0 until two starts of a turn were received
  std::string_view return_mode;        ///< only if `model` is known
  double rotation_rate_rpm = 0, packets_per_s = 0;
  std::optional<velodyne::PpsState> pps; ///< Velodyne only; empty: no position packet was received
  std::optional<TimeScale> clock;        ///< Ouster or Hesai
  std::optional<UnknownPackets> unknown_packets;

  [[nodiscard]] bool is_known() const { return !model.empty() || ouster; }
  /// Returns true if the lidar's clock is synchronised: a Velodyne reports it in position packets, the others by the
  /// time in their data packets.
  [[nodiscard]] bool is_synchronised() const {
    return clock ? *clock != TimeScale::free_running : pps == velodyne::PpsState::locked;
  }
  /// Returns for example "PPS locked" or "clock UTC".
  [[nodiscard]] std::string clock_state() const;

  /// Returns for example "VLP-16 at 192.168.1.201" or "Ouster 122201000998 at 192.168.1.202".
  [[nodiscard]] std::string name() const;
};

/// Identifies the lidars on a network from captured datagrams. Single owner, not thread-safe.
class LidarSurvey {
 public:
  static constexpr std::size_t kMaxSenders = 64; ///< more than any robot has; further senders are ignored

  void add(const Datagram& datagram);
  /// Returns the lidars, ordered by address and port.
  [[nodiscard]] std::vector<SurveyedLidar> lidars() const;

 private:
  /// Mode of an Ouster (columns per turn, rate), estimated from the packet times, since no field reports it.
  struct OusterMode {
    struct Turn {
      std::uint16_t frame_id;
      Duration begin;
    };
    std::optional<std::uint16_t> frame_id; ///< frame ID of the latest packet
    std::optional<Turn> first, last;       ///< turns whose first packet was received
    Duration column{};                     ///< time from one column to the next

    void add(const ouster::PacketFormat& format, std::span<const std::byte> packet);
    [[nodiscard]] double turns_per_s() const; ///< 0 until two starts of a turn were received
    [[nodiscard]] std::size_t columns_per_turn() const;
  };
  struct Sender {
    velodyne::Decoder velodyne;
    hesai::Decoder hesai;
    LidarPacket packet;
    std::optional<std::uint64_t> ouster; ///< SurveyedLidar::ouster
    std::size_t beams = 0;
    OusterMode mode;
    TimeScale clock{};            ///< Ouster or Hesai
    UnknownPackets unknown_other; ///< of another maker, or of an unsupported model of Hesai
    std::uint64_t packets = 0;    ///< decoded packets, or column packets of an Ouster
    Stamp first, last;

    bool read(const Datagram& datagram);
    void refuse(OtherMaker maker, const hesai::Looks& looks);
    void read_ouster(const ouster::PacketFormat& format, const Datagram& datagram);
  };

  std::map<std::pair<std::uint32_t, std::uint16_t>, std::unique_ptr<Sender>> senders_; ///< keyed by address and port
  std::map<std::uint32_t, velodyne::PpsState> pps_;                                    ///< keyed by address
};

} // namespace locus
