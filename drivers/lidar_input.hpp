// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/base/expected.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "core/sources/motion_sample.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/lidar_options.hpp"
#include "drivers/net/datagram.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/sensor_clock.hpp"
#include "drivers/sensor_time.hpp"
#include "drivers/unknown_packets.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {

/// Position packets go to this port, or to the one as far from the data port as this is from the default one.
inline constexpr std::uint16_t kDefaultDataPort = 2368;
inline constexpr std::uint16_t kDefaultPositionPort = 8308;

/// The name of the model that the configuration says a lidar is; empty where it says none, and for an Ouster.
std::string_view configured_model(const LidarOptions& options);

/// Lengths of what a lidar sends: those of its data packets, then others. The spans are of what is here, so there are
/// none of a temporary.
struct PacketLengths {
  std::array<std::size_t, 24> storage{};
  std::size_t data = 0, count = 0;

  [[nodiscard]] std::span<const std::size_t> all() const& { return {storage.data(), count}; }
  [[nodiscard]] std::span<const std::size_t> of_data() const& { return all().first(data); }
  void all() && = delete;
  void of_data() && = delete;
};

/// One lidar: datagrams in, packets of returns with stamps of the host's clock out, every datagram counted.
///
/// - Sender: without a configured address, the first one that sends a good data packet is the lidar; another takes its
///   place only after a second of silence.
/// - A packet that was overtaken by another (up to 100 ms) is counted as reordered and given out like any other: its
/// stamp
///   lies before that of the packet given out last. It is no longer counted as lost.
/// - Lost are the packets missing where their numbers leave a gap, or, without numbers, where the stamps do and the
/// azimuth, for gaps up to one second, leaves the same.
/// - A lidar of which nothing tells the maker is of that of the first packets that can be read.
/// - An Ouster also sends the readings of its inertial unit, which are counted as position packets are.
///
/// One owner. Allocates nothing, throws nothing after open().
class LidarInput {
 public:
  /// Reads the file of angles, if there is one, and an Ouster's metadata. Fails with one line for the user.
  static Expected<LidarInput, std::string> open(LidarOptions options, std::uint8_t index);

  /// Takes a datagram; the packet it makes, valid until the next call, or nullptr if it makes none.
  const LidarPacket* receive(const Datagram& datagram);

  /// What the datagram told of the lidar's inertial unit, in that one's frame; of most datagrams, nothing.
  [[nodiscard]] std::span<const ImuSample> imu_samples() const { return {imu_samples_.data(), imu_count_}; }

  /// Whether datagrams to this port can be for this lidar; none is for one that gives clouds.
  [[nodiscard]] bool listens_to(std::uint16_t port) const;

  /// Lengths of what it sends, or may send while its model is yet to be told.
  [[nodiscard]] PacketLengths packet_lengths() const;

  /// Address of the lidar: configured, or learnt from its data packets.
  [[nodiscard]] std::optional<std::uint32_t> source_ip() const;

  /// Who sent the last packet of a lidar that was refused for its sender.
  [[nodiscard]] std::optional<std::uint32_t> refused_ip() const { return refused_ip_; }

  /// Somebody else who sends data packets to this lidar's port.
  struct Stranger {
    std::uint32_t ip = 0;      ///< host byte order
    std::uint64_t packets = 0; ///< that were refused for it
    Stamp last_heard;          ///< arrival of the last of them
  };
  static constexpr std::size_t kMaxStrangers = 4;
  using Strangers = std::array<Stranger, kMaxStrangers>;

  /// The first few, in the order in which they were heard; those without packets are none.
  [[nodiscard]] const Strangers& strangers() const { return strangers_; }

  /// When the last packet that was taken arrived; Stamp{} before the first.
  [[nodiscard]] Stamp last_heard() const { return last_heard_; }
  /// The same of those that were refused for their model, see unknown_packets().
  [[nodiscard]] Stamp unknown_last_heard() const { return unknown_last_heard_; }

  [[nodiscard]] const LidarOptions& options() const { return options_; }
  [[nodiscard]] const PacketCounters& counters() const { return counters_; }
  /// nullptr for a lidar of another maker; so the next.
  [[nodiscard]] const velodyne::Decoder* velodyne() const { return std::get_if<velodyne::Decoder>(&decoder_); }
  [[nodiscard]] const ouster::Decoder* ouster() const { return std::get_if<ouster::Decoder>(&decoder_); }
  [[nodiscard]] const hesai::Decoder* hesai() const { return std::get_if<hesai::Decoder>(&decoder_); }

  /// As what its packets are read; empty before the first good one. The texts live for ever; so the next two.
  [[nodiscard]] std::string_view model() const;
  [[nodiscard]] std::string_view return_mode() const;
  /// What its packets say that they come from, as far as that is told, whether or not they are read as that.
  [[nodiscard]] std::string_view recognised_model() const;
  /// Of a Velodyne, its PpsState; of lidars whose packets tell the date, the TimeScale of their clocks.
  [[nodiscard]] std::string_view clock_state() const;
  [[nodiscard]] bool tells_date() const { return velodyne() == nullptr; }
  /// Of the last good packet; 0 before the first.
  [[nodiscard]] double rotation_rate_rpm() const;
  /// Of packets of no model that can be read; of an Ouster, nothing.
  [[nodiscard]] std::optional<UnknownPackets> unknown_packets() const;
  /// The latest position packet.
  [[nodiscard]] const std::optional<velodyne::PositionPacket>& position() const { return position_; }

 private:
  using Decoder = std::variant<velodyne::Decoder, ouster::Decoder, hesai::Decoder>;
  /// What tells packets apart: all of a Velodyne's, the beginning of longer ones.
  using Payload = std::array<std::byte, velodyne::kDataPacketBytes>;

  LidarInput(LidarOptions options, std::uint8_t index, Decoder decoder);
  static Expected<Decoder, std::string> decoder_for(const LidarOptions& options);

  void follow_maker(const Datagram& datagram);
  std::optional<PacketError> take(const Datagram& datagram);
  std::optional<PacketError> take_decoded(const Datagram& datagram);
  std::optional<PacketError> take_data(const Datagram& datagram);
  std::optional<PacketError> take_position(const Datagram& datagram);
  std::optional<PacketError> take_imu(const Datagram& datagram);
  std::optional<PacketError> decode(const Datagram& datagram);
  void refuse_hesai(const hesai::Looks& looks);
  std::optional<PacketError> decode_hesai(hesai::Decoder& decoder, const Datagram& datagram);
  [[nodiscard]] bool is_data_packet(const Datagram& datagram) const;
  [[nodiscard]] Duration time_of_hour() const;
  [[nodiscard]] bool is_sender(const Datagram& datagram) const;
  [[nodiscard]] bool is_duplicate(std::span<const std::byte> payload) const;
  void refuse_sender(const Datagram& datagram);
  [[nodiscard]] double turn_of_packet_cdeg() const;
  [[nodiscard]] Duration nominal_duration() const;
  [[nodiscard]] std::uint64_t missing_before(const SensorClock::Reading& reading) const;
  void count(const SensorClock::Reading& reading);
  void remember(const Datagram& datagram);

  LidarOptions options_;
  Decoder decoder_;
  SensorClock clock_;
  LidarPacket packet_;
  const LidarPacket* ready_ = nullptr; ///< made of the datagram at hand
  PacketCounters counters_;
  std::optional<velodyne::PositionPacket> position_;
  TimeScale time_scale_ = TimeScale::free_running; ///< of packets that tell the date
  UnknownPackets unknown_hesai_;                   ///< the latest that was refused for its model
  std::array<ImuSample, ouster::ImuMeasurements::kMost> imu_samples_;
  std::size_t imu_count_ = 0;

  std::optional<std::uint32_t> learnt_ip_, refused_ip_;
  Strangers strangers_{};
  Stamp last_heard_, unknown_last_heard_;
  std::uint16_t last_azimuth_cdeg_ = 0; ///< of the first firing of the latest packet
  std::size_t last_first_column_ = 0;   ///< of the same, of an Ouster
  std::uint32_t last_number_ = 0;       ///< of the same, of a Hesai
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

  /// What the datagram told of a lidar's inertial unit, see LidarInput::imu_samples().
  struct Imu {
    std::uint8_t lidar = 0; ///< index
    std::span<const ImuSample> samples;
  };
  [[nodiscard]] Imu imu() const {
    return latest_ ? Imu{static_cast<std::uint8_t>(*latest_), lidars_[*latest_].imu_samples()} : Imu{};
  }

  /// The lidar that a datagram comes from by the configuration alone, whether or not it has made itself known.
  struct Origin {
    std::string_view lidar;                     ///< its name; empty for none
    const ouster::Metadata* metadata = nullptr; ///< of an Ouster
  };
  /// What it refers to lives as long as the router.
  [[nodiscard]] Origin configured_for(const Datagram& datagram) const;

  /// Addresses, host byte order, none: anybody may be one; and the lengths of what lidars send.
  struct Senders {
    static constexpr std::size_t kMax = 16;
    std::array<std::uint32_t, kMax> ips{};
    std::size_t count = 0;
    static constexpr std::size_t kMaxLengths = 2 * kMax + std::tuple_size_v<decltype(PacketLengths::storage)>;
    std::array<std::size_t, kMaxLengths> lengths{velodyne::kDataPacketBytes, velodyne::kPositionPacketBytes};
    std::size_t length_count = 2;

    void add_lengths(std::span<const std::size_t> more);

    [[nodiscard]] std::span<const std::uint32_t> all() const { return {ips.data(), count}; }
    [[nodiscard]] std::span<const std::size_t> all_lengths() const { return {lengths.data(), length_count}; }
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
  std::optional<std::size_t> latest_; ///< that the last datagram came from; nothing for a foreign one
  PacketCounters foreign_;
};

} // namespace locus
