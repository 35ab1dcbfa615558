// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/base/expected.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "core/sources/motion_sample.hpp"
#include "drivers/lidar_options.hpp"
#include "drivers/lidar_sender.hpp"
#include "drivers/loss_counter.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/packet_decoder.hpp"
#include "drivers/recent_packets.hpp"
#include "drivers/sensor_clock.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "drivers/velodyne/pps_watch.hpp"

namespace locus {

/// Default UDP ports of a Velodyne. Position packets are accepted on 8308 and at the same offset from a configured data
/// port.
inline constexpr std::uint16_t kDefaultDataPort = 2368;
inline constexpr std::uint16_t kDefaultPositionPort = 8308;

/// One lidar: turns datagrams into packets of returns, stamped in the host's clock. Counts every datagram.
///
/// - Sender: see LidarSender. Loss: see LossCounter. Time: see SensorClock.
/// - Reordering: a packet overtaken by up to 100 ms is counted as reordered and returned as usual; its stamp precedes
///   that of the packet before it.
/// - Maker: if not configured, the maker of the first readable packets, and another one's after a second of silence.
/// - Ouster: IMU packets are counted as position packets.
///
/// Single owner, not thread-safe. After open(), allocates nothing and throws nothing.
class LidarInput {
 public:
  /// Reads the calibration file, if there is one, and an Ouster's metadata. Fails with one line for the user.
  static Expected<LidarInput, std::string> open(LidarOptions options, std::uint8_t index);

  /// Processes a datagram. Returns the packet decoded from it, valid until the next call, or nullptr if there is none.
  const LidarPacket* receive(const Datagram& datagram);

  /// Returns the IMU samples of the latest datagram in the IMU's frame; empty for most datagrams.
  [[nodiscard]] std::span<const ImuSample> imu_samples() const { return {imu_samples_.data(), imu_count_}; }

  /// Returns true if this lidar accepts datagrams on `port`; always false for a lidar that provides clouds.
  [[nodiscard]] bool listens_to(std::uint16_t port) const;

  [[nodiscard]] const LidarOptions& options() const { return options_; }
  [[nodiscard]] const PacketDecoder& decoder() const { return decoder_; }
  [[nodiscard]] const LidarSender& sender() const { return sender_; }
  [[nodiscard]] const PacketCounters& counters() const { return counters_; }
  /// Arrival of the latest packet rejected for its model, see PacketDecoder::unknown_packets().
  [[nodiscard]] Stamp unknown_last_received() const { return unknown_last_received_; }

  /// Model as which its packets are decoded; empty before the first good packet. The text has static lifetime, as in
  /// the next three.
  [[nodiscard]] std::string_view model() const;
  [[nodiscard]] std::string_view return_mode() const;
  /// State of the lidar's clock: PpsState of a Velodyne, TimeScale of a lidar whose packets carry the date.
  [[nodiscard]] std::string_view clock_state() const;
  /// Says why the time of a Velodyne with a locked PPS has not been used for more than five seconds; empty if it is
  /// used, was configured not to be or PPS is not locked.
  [[nodiscard]] std::string_view why_pps_is_unused() const { return pps_.why_unused(sender_.last_received()); }
  /// Latest position packet.
  [[nodiscard]] const std::optional<velodyne::PositionPacket>& position() const { return position_; }

 private:
  LidarInput(LidarOptions options, std::uint8_t index, PacketDecoder decoder);

  std::optional<PacketError> process(const Datagram& datagram);
  std::optional<PacketError> process_decoded(const Datagram& datagram);
  std::optional<PacketError> process_data(const Datagram& datagram);
  void process_position(const Datagram& datagram);
  std::optional<PacketError> process_imu(const Datagram& datagram);

  LidarOptions options_;
  PacketDecoder decoder_;
  SensorClock clock_;
  LidarSender sender_;
  LossCounter loss_;
  RecentPackets recent_;
  velodyne::PpsWatch pps_;

  LidarPacket packet_;
  const LidarPacket* ready_ = nullptr; ///< decoded from the current datagram
  PacketCounters counters_;
  std::optional<velodyne::PositionPacket> position_;
  std::array<ImuSample, ouster::ImuMeasurements::kMost> imu_samples_;
  std::size_t imu_count_ = 0;
  Stamp unknown_last_received_;
};

} // namespace locus
