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

/// What the configuration knows better than the packets.
struct DecoderOptions {
  std::optional<Model> model = std::nullopt;             ///< nothing: told by look_at()
  std::optional<Calibration> calibration = std::nullopt; ///< nothing: the model's own table
  Isa isa = best_isa();
};

/// Turns data packets into returns, each with the direction and the time of its own firing.
///
/// The azimuth of a firing is that of its block plus what the lidar turns from the instant of that azimuth until it
/// fires, at the motor's speed that the packet tells and in the direction in which the azimuths go on (it can be set to
/// turn counterclockwise). Where a field of view was set, a packet may hold the columns before and behind the blind
/// sector: there is so much more time between them. With several returns, one at the distance of another is none.
///
/// Axes: x is azimuth 0, y left, z up: the maker's sensor frame, whose y is azimuth 0 and whose x points right, turned
/// by 90 degrees. The origin is the maker's.
///
/// A lidar whose checksums have been right once is held to them from then on.
///
/// One owner. Allocates nothing, throws nothing. A packet that is refused leaves the decoder as it was.
class Decoder {
 public:
  explicit Decoder(const DecoderOptions& options = {}) : options_(options) {}

  /// Fills everything of `packet` but lidar and stamp, or says why not and leaves `packet` undefined: flag (no start
  /// of a packet or block), model (that cannot be read, another than the configured one, an unknown return mode, or
  /// another number of lasers than the calibration has), length, azimuth, time (a date that is none), checksum.
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Of the packets so far; nothing before the first good one.
  [[nodiscard]] std::optional<Model> model() const { return model_; }
  [[nodiscard]] std::optional<ReturnMode> return_mode() const { return mode_; }
  /// What the last packet looked like, whether or not it was read; nothing where it did not look like one of Hesai.
  [[nodiscard]] std::optional<Looks> recognised() const { return recognised_; }

  /// Of the last good packet: when its first firing was, by the sensor's clock: since 1970 in UTC, or TAI, if somebody
  /// has set it. >= 0.
  [[nodiscard]] Duration time() const { return time_; }
  /// Of the last good packet: its number among all that the lidar has sent; nothing of one that does not number them.
  [[nodiscard]] std::optional<std::uint32_t> number() const { return number_; }
  /// The same, as long as its columns take: what the next one follows after.
  [[nodiscard]] Duration nominal_duration() const;
  /// The same, as the packet tells.
  [[nodiscard]] double rotation_rate_rpm() const { return motor_rpm_; }
  [[nodiscard]] std::size_t packet_bytes() const { return packet_bytes_; }
  [[nodiscard]] bool has_checksums() const { return has_checksums_; }

 private:
  using Packet = std::span<const std::byte>;
  using Distances = FiringGroup::PerLaser<std::int32_t>;
  static constexpr std::size_t kMaxReturns = 3;

  /// What a packet says of itself.
  struct Heading {
    Model model;
    const ModelSpec* spec;
    ReturnMode mode;
    std::size_t tail; ///< where it begins
    bool has_number;
    float distance_unit_m;
    double motor_rpm;
    Duration time; ///< since 1970
    bool has_right_sums;
  };
  /// The columns of the packet at hand.
  struct Columns {
    std::size_t count = 0;
    std::array<std::uint16_t, kMaxBlocks> azimuth_cdeg{};
    std::array<std::int32_t, kMaxBlocks> offset_ns{}; ///< of the azimuth's instant after that of the first
    Duration duration{};                              ///< of all
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
  std::array<SpinningBeams, 2> beams_{}; ///< by sequence
  std::array<std::int32_t, 2> first_firing_ns_{};
  std::size_t sequence_ = 0; ///< of the first column of the last good packet
  std::int32_t least_distance_ = 1;
  float distance_unit_m_ = 0.0F;

  Columns columns_;
  int direction_ = 1; ///< 1 is clockwise, -1 is not
  std::uint16_t last_azimuth_cdeg_ = 0;
  Duration time_{};
  std::optional<Duration> last_time_;
  std::optional<std::uint32_t> number_;
  double motor_rpm_ = 0.0;
  std::size_t packet_bytes_ = 0;
  bool has_checksums_ = false;
};

} // namespace locus::hesai
