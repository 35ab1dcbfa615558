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
#include "drivers/sent_sectors.hpp"
#include "drivers/unknown_packets.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne/position_packet.hpp"

namespace locus {

/// Default UDP ports of a Velodyne. Position packets are accepted on 8308 and at the same offset from a configured data
/// port.
inline constexpr std::uint16_t kDefaultDataPort = 2368;
inline constexpr std::uint16_t kDefaultPositionPort = 8308;

/// Returns the name of the configured model; empty if none is configured, and for an Ouster.
std::string_view configured_model(const LidarOptions& options);

/// Reads an Ouster's metadata from the text or the file of its options. Fails with one line for the user.
Expected<ouster::Metadata, std::string> metadata_of(const LidarOptions& options);

/// Lengths of a lidar's packets in bytes: data packets first, then the others. The spans refer to this object, so calls
/// on temporaries are deleted.
struct PacketLengths {
  std::array<std::size_t, 24> storage{};
  std::size_t data = 0, count = 0;

  [[nodiscard]] std::span<const std::size_t> all() const& { return {storage.data(), count}; }
  [[nodiscard]] std::span<const std::size_t> of_data() const& { return all().first(data); }
  void all() && = delete;
  void of_data() && = delete;
};

/// One lidar: turns datagrams into packets of returns, stamped in the host's clock. Counts every datagram.
///
/// - Sender: without a configured address, the first sender of a good data packet becomes the lidar; another sender
///   replaces it only after one second of silence.
/// - Reordering: a packet overtaken by up to 100 ms is counted as reordered and returned as usual; its stamp precedes
///   that of the packet before it. It is no longer counted as lost.
/// - Loss: counted from gaps in the packet numbers. Without numbers, it is counted from gaps in the stamps, confirmed
///   by the azimuth for gaps of up to one second; a sector that is never sent is no loss.
/// - Maker: if not configured, the maker of the first readable packets.
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

  /// Returns the lengths of its packets; of all candidate models while the model is unknown.
  [[nodiscard]] PacketLengths packet_lengths() const;

  /// Address of the lidar, host byte order: configured, or learnt from its data packets.
  [[nodiscard]] std::optional<std::uint32_t> source_ip() const;

  /// Source address of the last data packet rejected because of its sender.
  [[nodiscard]] std::optional<std::uint32_t> refused_ip() const { return refused_ip_; }

  /// Another sender of data packets to this lidar's port.
  struct OtherSender {
    std::uint32_t ip = 0;      ///< host byte order
    std::uint64_t packets = 0; ///< rejected packets from this sender
    Stamp last_received;       ///< arrival of the latest of them
  };
  static constexpr std::size_t kMaxOtherSenders = 4;
  using OtherSenders = std::array<OtherSender, kMaxOtherSenders>;

  /// The first kMaxOtherSenders other senders, in order of arrival; entries with zero packets are unused.
  [[nodiscard]] const OtherSenders& other_senders() const { return other_senders_; }

  /// Arrival of the latest accepted packet; Stamp{} before the first.
  [[nodiscard]] Stamp last_received() const { return last_received_; }
  /// Arrival of the latest packet rejected for its model, see unknown_packets().
  [[nodiscard]] Stamp unknown_last_received() const { return unknown_last_received_; }

  [[nodiscard]] const LidarOptions& options() const { return options_; }
  [[nodiscard]] const PacketCounters& counters() const { return counters_; }
  /// Returns the decoder, or nullptr for a lidar of another maker. The same applies to the next two.
  [[nodiscard]] const velodyne::Decoder* velodyne() const { return std::get_if<velodyne::Decoder>(&decoder_); }
  [[nodiscard]] const ouster::Decoder* ouster() const { return std::get_if<ouster::Decoder>(&decoder_); }
  [[nodiscard]] const hesai::Decoder* hesai() const { return std::get_if<hesai::Decoder>(&decoder_); }

  /// Model as which its packets are decoded; empty before the first good packet. The text has static lifetime, as in
  /// the next two.
  [[nodiscard]] std::string_view model() const;
  [[nodiscard]] std::string_view return_mode() const;
  /// Model that its packets report, if they do, whether or not they are decoded as that model.
  [[nodiscard]] std::string_view recognised_model() const;
  /// State of the lidar's clock: PpsState of a Velodyne, TimeScale of a lidar whose packets carry the date.
  [[nodiscard]] std::string_view clock_state() const;
  /// Says why the time of a Velodyne with a locked PPS has not been used for more than five seconds; empty if it is
  /// used, was configured not to be or PPS is not locked.
  [[nodiscard]] std::string_view why_pps_is_unused() const;
  [[nodiscard]] bool has_date() const { return velodyne() == nullptr; }
  /// Rotation rate of the last good packet; 0 before the first.
  [[nodiscard]] double rotation_rate_rpm() const;
  /// Packets that cannot be decoded because their model is unknown or differs; empty for an Ouster.
  [[nodiscard]] std::optional<UnknownPackets> unknown_packets() const;
  /// Latest position packet.
  [[nodiscard]] const std::optional<velodyne::PositionPacket>& position() const { return position_; }

 private:
  using Decoder = std::variant<velodyne::Decoder, ouster::Decoder, hesai::Decoder>;
  /// Bytes that identify a packet for duplicate detection: all of a Velodyne packet, the beginning of longer ones.
  using Payload = std::array<std::byte, velodyne::kDataPacketBytes>;

  LidarInput(LidarOptions options, std::uint8_t index, Decoder decoder);
  static Expected<Decoder, std::string> decoder_for(const LidarOptions& options);

  void follow_maker(const Datagram& datagram);
  std::optional<PacketError> process(const Datagram& datagram);
  std::optional<PacketError> process_decoded(const Datagram& datagram);
  std::optional<PacketError> process_data(const Datagram& datagram);
  void process_position(const Datagram& datagram);
  std::optional<PacketError> process_imu(const Datagram& datagram);
  std::optional<PacketError> decode(const Datagram& datagram);
  void refuse(OtherMaker maker, std::string_view model = "", bool is_readable = false);
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
  void count_lost(const SensorClock::Reading& reading);
  void store(const Datagram& datagram);

  LidarOptions options_;
  Decoder decoder_;
  SensorClock clock_;
  LidarPacket packet_;
  const LidarPacket* ready_ = nullptr; ///< decoded from the current datagram
  PacketCounters counters_;
  std::optional<velodyne::PositionPacket> position_;
  std::string_view pps_unused_for_; ///< velodyne::why_unused() of the last position packet that was not used
  Stamp pps_unused_since_;
  std::optional<Stamp> pps_used_since_;            ///< empty while it is not used
  TimeScale time_scale_ = TimeScale::free_running; ///< only for packets that carry the date
  UnknownPackets unknown_other_;                   ///< the latest packets rejected as another maker's or model's
  std::array<ImuSample, ouster::ImuMeasurements::kMost> imu_samples_;
  std::size_t imu_count_ = 0;

  std::optional<std::uint32_t> learnt_ip_, refused_ip_;
  OtherSenders other_senders_{};
  Stamp last_received_, unknown_last_received_;
  std::uint16_t last_azimuth_cdeg_ = 0; ///< first firing of the latest packet
  std::size_t last_first_column_ = 0;   ///< first column of the latest packet; Ouster only
  std::uint32_t last_number_ = 0;       ///< sequence number of the latest packet; Hesai only
  Duration last_duration_{};            ///< duration of the latest packet
  SentSectors sectors_;                 ///< only for packets without numbers

  static constexpr std::size_t kStored = 8;
  std::array<Payload, kStored> recent_{}; ///< latest packets, for duplicate detection
  std::size_t stored_ = 0;
};

/// Routes each datagram to its lidar, by destination port and source address. Single owner, not thread-safe.
class LidarRouter {
 public:
  /// Opens all lidars. Fails with one line for the user.
  static Expected<LidarRouter, std::string> open(const std::vector<LidarOptions>& options);

  /// Processes a datagram. Returns the packet decoded from it (LidarPacket::lidar is the index of the lidar), valid
  /// until the next call, or nullptr if there is none.
  const LidarPacket* receive(const Datagram& datagram);

  [[nodiscard]] const std::vector<LidarInput>& lidars() const { return lidars_; }

  /// Index of the lidar that processed the latest datagram; empty if it matched none.
  [[nodiscard]] std::optional<std::size_t> latest() const { return latest_; }

  /// IMU samples of the latest datagram, see LidarInput::imu_samples().
  struct Imu {
    std::uint8_t lidar = 0; ///< index
    std::span<const ImuSample> samples;
  };
  [[nodiscard]] Imu imu() const {
    return latest_ ? Imu{static_cast<std::uint8_t>(*latest_), lidars_[*latest_].imu_samples()} : Imu{};
  }

  /// Lidar to which the configuration alone assigns a datagram, whether or not that lidar has sent anything yet.
  struct Origin {
    std::string_view lidar;                     ///< name of the lidar; empty if none matches
    const ouster::Metadata* metadata = nullptr; ///< Ouster only, otherwise nullptr
  };
  /// Finds the configured lidar of a datagram. The result refers to data that lives as long as the router.
  [[nodiscard]] Origin configured_for(const Datagram& datagram) const;

  /// Addresses of senders, host byte order (empty: any sender is possible), and the lengths of lidar packets in bytes.
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

  /// Returns the senders of the lidars that listen to `port`; without addresses while one of these lidars has none,
  /// configured or learnt.
  [[nodiscard]] Senders senders_to(std::uint16_t port) const;

  /// Sum over all lidars and over the datagrams that match none of them (rejected as sender).
  [[nodiscard]] PacketCounters total() const;

 private:
  explicit LidarRouter(std::vector<LidarInput> lidars) : lidars_(std::move(lidars)) {}
  LidarInput* find(const Datagram& datagram);

  std::vector<LidarInput> lidars_;
  std::optional<std::size_t> latest_; ///< index of the lidar that sent the last datagram; empty if none matched
  PacketCounters foreign_;
};

} // namespace locus
