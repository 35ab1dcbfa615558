// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/expected.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/lidar_options.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/sensor_clock.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {

/// Position packets go to this port, or to the one as far from the data port as this is from the default one.
inline constexpr std::uint16_t kDefaultDataPort = 2368;
inline constexpr std::uint16_t kDefaultPositionPort = 8308;

/// One lidar: datagrams in, packets of returns with stamps of the host's clock out, every datagram counted.
///
/// - Sender: without a configured address, the first one that sends a good data packet is the lidar; another takes its
///   place only after a second of silence.
/// - A packet that was overtaken by another (up to 100 ms) is counted as reordered and given out like any other: its
/// stamp
///   lies before that of the packet given out last. It is no longer counted as lost.
/// - Lost are the packets missing where the stamps leave a gap and the azimuth, for gaps up to one second, leaves the
/// same.
///
/// One owner. Allocates nothing, throws nothing after open().
class LidarInput {
 public:
  /// Reads the calibration file, if there is one. Fails with one line for the user.
  static Expected<LidarInput, std::string> open(LidarOptions options, std::uint8_t index);

  /// Takes a datagram; the packet it makes, valid until the next call, or nullptr if it makes none.
  const LidarPacket* receive(const Datagram& datagram);

  /// Whether datagrams to this port can be for this lidar.
  [[nodiscard]] bool listens_to(std::uint16_t port) const;

  /// Address of the lidar: configured, or learnt from its data packets.
  [[nodiscard]] std::optional<std::uint32_t> source_ip() const;

  /// Who sent the last packet of a lidar that was refused for its sender.
  [[nodiscard]] std::optional<std::uint32_t> refused_ip() const { return refused_ip_; }

  /// Somebody else who sends data packets to this lidar's port.
  struct Stranger {
    std::uint32_t ip = 0;      ///< host byte order
    std::uint64_t packets = 0; ///< that were refused for it
  };
  static constexpr std::size_t kMaxStrangers = 4;
  using Strangers = std::array<Stranger, kMaxStrangers>;

  /// The first few, in the order in which they were heard; those without packets are none.
  [[nodiscard]] const Strangers& strangers() const { return strangers_; }

  /// When the last packet that was taken arrived; Stamp{} before the first.
  [[nodiscard]] Stamp last_heard() const { return last_heard_; }

  [[nodiscard]] const LidarOptions& options() const { return options_; }
  [[nodiscard]] const PacketCounters& counters() const { return counters_; }
  [[nodiscard]] const velodyne::Decoder& decoder() const { return decoder_; }
  /// The latest position packet.
  [[nodiscard]] const std::optional<velodyne::PositionPacket>& position() const { return position_; }

 private:
  using Payload = std::array<std::byte, velodyne::kDataPacketBytes>;

  LidarInput(LidarOptions options, std::uint8_t index, std::optional<velodyne::Calibration> calibration);

  std::optional<PacketError> take(const Datagram& datagram);
  std::optional<PacketError> take_decoded(const Datagram& datagram);
  std::optional<PacketError> take_data(const Datagram& datagram);
  [[nodiscard]] bool is_sender(const Datagram& datagram) const;
  [[nodiscard]] bool is_duplicate(std::span<const std::byte> payload) const;
  void refuse_sender(const Datagram& datagram);
  [[nodiscard]] double speed_tolerance() const;
  [[nodiscard]] std::uint64_t missing_before(const SensorClock::Reading& reading) const;
  void count(const SensorClock::Reading& reading);
  void remember(const Datagram& datagram);

  LidarOptions options_;
  velodyne::Decoder decoder_;
  SensorClock clock_;
  LidarPacket packet_;
  bool packet_is_ready_ = false;
  PacketCounters counters_;
  std::optional<velodyne::PositionPacket> position_;

  std::optional<std::uint32_t> learnt_ip_, refused_ip_;
  Strangers strangers_{};
  Stamp last_heard_;
  std::uint16_t last_azimuth_cdeg_ = 0; ///< of the first firing of the latest packet
  Duration last_duration_{};            ///< of that packet

  static constexpr std::size_t kRemembered = 8;
  std::array<Payload, kRemembered> recent_{}; ///< for telling duplicates
  std::size_t remembered_ = 0;
};

/// Several lidars: each datagram to the one it comes from, told by destination port and source address. One owner.
class LidarRouter {
 public:
  /// Fails with one line for the user.
  static Expected<LidarRouter, std::string> open(const std::vector<LidarOptions>& options);

  /// Takes a datagram; the packet it makes (LidarPacket::lidar says whose), valid until the next call, or nullptr.
  const LidarPacket* receive(const Datagram& datagram);

  [[nodiscard]] const std::vector<LidarInput>& lidars() const { return lidars_; }

  /// The name of the lidar that a datagram comes from by the configuration alone, whether or not the lidar has made
  /// itself known; empty for none.
  [[nodiscard]] std::string_view configured_for(const Datagram& datagram) const;

  /// Addresses, host byte order. None: anybody may be one.
  struct Senders {
    static constexpr std::size_t kMax = 16;
    std::array<std::uint32_t, kMax> ips{};
    std::size_t count = 0;

    [[nodiscard]] std::span<const std::uint32_t> all() const { return {ips.data(), count}; }
    bool operator==(const Senders&) const = default;
  };

  /// Of the lidars that may send to this port; none while one of them has no address, configured or learnt.
  [[nodiscard]] Senders senders_to(std::uint16_t port) const;

  /// Of all lidars, and of the datagrams that are for none of them (rejected as sender).
  [[nodiscard]] PacketCounters total() const;

 private:
  explicit LidarRouter(std::vector<LidarInput> lidars) : lidars_(std::move(lidars)) {}
  LidarInput* find(const Datagram& datagram);

  std::vector<LidarInput> lidars_;
  PacketCounters foreign_;
};

} // namespace locus
