// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/isa.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/hesai/model.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/spinning.hpp"

namespace locus::hesai {

/// Configured settings that override the packets.
struct DecoderOptions {
  std::optional<Model> model = std::nullopt;             ///< empty: determined by look_at()
  std::optional<Calibration> calibration = std::nullopt; ///< empty: built-in table of the model
  Isa isa = best_isa();
};

/// Decodes data packets into returns, each with the direction and the time of its own firing.
///
/// The azimuth of a firing is that of its block plus the rotation from the instant of that azimuth to the firing, at
/// the motor speed in the packet and in the direction in which the azimuths advance (the lidar can be set to turn
/// counterclockwise). If a field of view is configured, a packet may span the blind sector, with a corresponding gap in
/// time. Of several returns at the same distance, only one is used.
///
/// Axes: x is azimuth 0, y left, z up: the maker's sensor frame, whose y is azimuth 0 and whose x points right, rotated
/// by 90 degrees. The origin is the maker's.
///
/// Once the checksums of a lidar have been correct, packets with wrong checksums are rejected.
///
/// Single owner, not thread-safe. Allocates nothing, throws nothing. A rejected packet leaves the decoder unchanged.
class Decoder {
 public:
  explicit Decoder(const DecoderOptions& options = {}) : options_(options) {}

  /// Fills all of `packet` except `lidar` and `stamp`. Returns the reason for rejection, if any; `packet` is then
  /// undefined: flag (no start of a packet or block), model (unsupported, different from the configured one, unknown
  /// return mode, or another number of lasers than the calibration), length, azimuth, time (invalid date), checksum.
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Model as which packets are decoded; empty before the first good packet. The same applies to the next.
  [[nodiscard]] std::optional<Model> model() const { return model_; }
  [[nodiscard]] std::optional<ReturnMode> return_mode() const { return mode_; }
  /// Model of the last packet by its header, whether or not it was decoded; empty if it was not a Hesai packet.
  [[nodiscard]] std::optional<Looks> recognised() const { return recognised_; }

  /// Time of the first firing of the last good packet in the sensor's clock: since 1970 in UTC or TAI, if the clock has
  /// been set. >= 0.
  [[nodiscard]] Duration time() const { return time_; }
  /// Sequence number of the last good packet; empty if the lidar does not number its packets.
  [[nodiscard]] std::optional<std::uint32_t> number() const { return number_; }
  /// Nominal time from the last good packet to the next: the duration of its columns.
  [[nodiscard]] Duration nominal_duration() const;
  /// Rotation rate reported in the last good packet.
  [[nodiscard]] double rotation_rate_rpm() const { return motor_rpm_; }
  [[nodiscard]] std::size_t packet_bytes() const { return packet_bytes_; }
  [[nodiscard]] bool has_checksums() const { return has_checksums_; }

 private:
  using Packet = std::span<const std::byte>;
  using Distances = FiringGroup::PerLaser<std::int32_t>;
  static constexpr std::size_t kMaxReturns = 3;

  /// Header and tail fields of a packet.
  struct Heading {
    Model model;
    const ModelSpec* spec;
    ReturnMode mode;
    std::size_t tail; ///< offset of the tail in bytes
    bool has_number;
    float distance_unit_m;
    double motor_rpm;
    Duration time; ///< since 1970
    bool has_right_sums;
  };
  /// Columns of the current packet.
  struct Columns {
    std::size_t count = 0;
    std::array<std::uint16_t, kMaxBlocks> azimuth_cdeg{};
    std::array<std::int32_t, kMaxBlocks> offset_ns{}; ///< from the first azimuth's instant to this one's
    Duration duration{};                              ///< duration of all columns
  };

  std::optional<PacketError> read_heading(Packet packet, Heading& heading) const;
  std::optional<PacketError> find_columns(Packet packet, const Heading& heading);
  void measure_direction(Duration time);
  void prepare(Model model);
  static std::size_t sequence_of(Packet packet, const Heading& heading, std::size_t column);
  void read_column(Packet packet, const Heading& heading, std::size_t column, const ColumnAzimuth& azimuth,
                   LidarPacket& out) const;
  void place(const Distances& distances, const Distances& another, const Distances& one_more,
             const SpinningBeams& beams, const Aim& aim, std::size_t first_channel, FiringGroup& group) const;

  DecoderOptions options_;
  std::optional<Looks> recognised_;
  std::optional<Model> model_;
  std::optional<ReturnMode> mode_;
  std::array<SpinningBeams, 2> beams_{}; ///< indexed by firing sequence
  std::array<std::int32_t, 2> first_firing_ns_{};
  std::size_t sequence_ = 0; ///< sequence of the first column of the last good packet
  std::int32_t least_distance_ = 1;
  float distance_unit_m_ = 0.0F;

  Columns columns_;
  int direction_ = 1; ///< 1: clockwise, -1: counterclockwise
  std::uint16_t last_azimuth_cdeg_ = 0;
  Duration time_{};
  std::optional<Duration> last_time_;
  std::optional<std::uint32_t> number_;
  double motor_rpm_ = 0.0;
  std::size_t packet_bytes_ = 0;
  bool has_checksums_ = false;
};

} // namespace locus::hesai
