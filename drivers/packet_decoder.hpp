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

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/hesai/decoder.hpp"
#include "drivers/lidar_options.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/sensor_time.hpp"
#include "drivers/unknown_packets.hpp"
#include "drivers/velodyne/decoder.hpp"

namespace locus {

/// Returns the name of the configured model; empty if none is configured, and for an Ouster.
std::string_view configured_model(const LidarOptions& options);

/// Reads an Ouster's metadata from the text or the file of its options. Fails with one line for the user.
Expected<ouster::Metadata, std::string> metadata_of(const LidarOptions& options);

/// Returns the largest number of returns of a lidar in a period of at least one turn: all its echoes of every firing.
/// Assumes the largest model while the configuration leaves it open.
std::size_t most_returns(const LidarOptions& options, Duration period);

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

/// Decoder of the packets of one lidar, of any maker; all that depends on the maker is here or in the maker's folder.
///
/// Single owner, not thread-safe. After open(), allocates nothing and throws nothing.
class PacketDecoder {
 public:
  /// Reads the calibration file, if there is one, and an Ouster's metadata. Fails with one line for the user.
  static Expected<PacketDecoder, std::string> open(const LidarOptions& options);

  /// Switches to the decoder of the maker that a packet belongs to, unless the configuration identifies the maker.
  void switch_maker(std::span<const std::byte> payload);

  /// Recognises data packets of this lidar by length or content.
  [[nodiscard]] bool is_data(std::span<const std::byte> payload) const;
  /// Recognises data packets of this lidar, or of any to which switch_maker() may switch.
  [[nodiscard]] bool may_be_data(std::span<const std::byte> payload) const;
  /// Recognises position packets; only a Velodyne has such.
  [[nodiscard]] bool is_position(std::span<const std::byte> payload) const;

  /// Fills all of `packet` except `lidar` and `stamp`. Returns the reason for rejection, if any. `host_now`: time of
  /// the host's clock at its arrival, see scale_of().
  std::optional<PacketError> decode(std::span<const std::byte> payload, Stamp host_now, LidarPacket& packet);

  /// Counts a packet that is not of this lidar in unknown_packets(). Returns `model`, or `length` for one of no known
  /// maker.
  PacketError reject(std::span<const std::byte> payload);

  /// Returns the lengths of its packets; of all candidate models while the model is unknown.
  [[nodiscard]] PacketLengths lengths() const;

  /// Model as which its packets are decoded. The text has static lifetime, as in the next two; it is empty before the
  /// first good packet, except for an Ouster.
  [[nodiscard]] std::string_view model() const;
  [[nodiscard]] std::string_view return_mode() const;
  /// Model that its packets report, if they do, whether or not they are decoded as that model.
  [[nodiscard]] std::string_view recognised_model() const;
  /// Packets that cannot be decoded because their model is unknown or differs; empty for an Ouster.
  [[nodiscard]] std::optional<UnknownPackets> unknown_packets() const;

  /// Time of hour of the last good packet.
  [[nodiscard]] Duration time_of_hour() const;
  /// Returns true if packets carry the date. Those of a Velodyne carry the time of hour alone.
  [[nodiscard]] bool has_date() const { return velodyne() == nullptr; }
  /// Scale of that time; `free_running` without a date.
  [[nodiscard]] TimeScale time_scale() const { return time_scale_; }

  /// Rotation rate of the last good packet; 0 before the first.
  [[nodiscard]] double rotation_rate_rpm() const;
  /// Rotation from the first to the last column of the last good packet, hundredths of a degree. Velodyne or Hesai.
  [[nodiscard]] double turn_of_packet_cdeg() const;
  /// Time from one packet to the next. Velodyne or Hesai.
  [[nodiscard]] Duration nominal_duration() const;

  /// Number of the last good packet, from which packets_since() counts: the first column of an Ouster's, the sequence
  /// number of a Hesai's. Empty if the packets have no numbers.
  [[nodiscard]] std::optional<std::uint32_t> number() const;
  /// Returns the number of packets that the lidar sent between the one with this number, `advance` before the last good
  /// packet, and that one; 0 if it has restarted its count. Precondition: number().
  [[nodiscard]] std::uint64_t packets_since(std::uint32_t number, Duration advance) const;

  /// Returns the decoder, or nullptr for a lidar of another maker. The same applies to the next two.
  [[nodiscard]] const velodyne::Decoder* velodyne() const { return std::get_if<velodyne::Decoder>(&decoder_); }
  [[nodiscard]] const ouster::Decoder* ouster() const { return std::get_if<ouster::Decoder>(&decoder_); }
  [[nodiscard]] const hesai::Decoder* hesai() const { return std::get_if<hesai::Decoder>(&decoder_); }

 private:
  using Payload = std::span<const std::byte>;
  using Decoder = std::variant<velodyne::Decoder, ouster::Decoder, hesai::Decoder>;

  PacketDecoder(const LidarOptions& options, Decoder decoder);
  static Expected<Decoder, std::string> decoder_for(const LidarOptions& options);

  std::optional<PacketError> decode_with(velodyne::Decoder& decoder, Payload payload, Stamp host_now,
                                         LidarPacket& packet);
  std::optional<PacketError> decode_with(ouster::Decoder& decoder, Payload payload, Stamp host_now,
                                         LidarPacket& packet);
  std::optional<PacketError> decode_with(hesai::Decoder& decoder, Payload payload, Stamp host_now, LidarPacket& packet);
  void count_unknown(OtherMaker maker, std::string_view model = "", bool is_readable = false);

  Decoder decoder_;
  std::optional<hesai::Model> configured_hesai_;
  bool is_of_any_maker_;
  Isa isa_;
  TimeScale time_scale_ = TimeScale::free_running;
  UnknownPackets unknown_other_; ///< the latest packets rejected as another maker's or model's
};

} // namespace locus
