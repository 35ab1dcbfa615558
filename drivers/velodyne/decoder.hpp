// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/base/isa.hpp"
#include "core/base/stamp.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "drivers/packet_counters.hpp"
#include "drivers/spinning.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/model_recognition.hpp"

namespace locus::velodyne {

/// Configured settings that override the packets.
struct DecoderOptions {
  std::optional<Model> model = std::nullopt;             ///< empty: determined by ModelRecognition
  std::optional<ReturnMode> return_mode = std::nullopt;  ///< empty: the packet's factory byte
  std::optional<Calibration> calibration = std::nullopt; ///< empty: built-in table of the model
  Isa isa = best_isa();
};

/// Description of packets of an unknown model or in an unknown return mode.
struct UnknownPackets {
  std::uint8_t product_id = 0;  ///< most frequent unknown ID
  std::uint8_t return_mode = 0; ///< return mode of the latest packet with that ID
  std::uint64_t packets = 0;    ///< number of packets with that ID
};

/// Returns for example "product id 0x31 and return mode 0x37 in 120 packets".
std::string to_string(const UnknownPackets& unknown);

/// Decodes data packets into returns, each with the direction and the time of its own firing.
///
/// The azimuth of a firing is that of its column plus the share of the turn to the next column that has elapsed at the
/// firing. For the last column the mean turn of the packet's columns is used; for a dual packet of the VLS-128, which
/// has one column, the turn since the previous packet (0 for the first packet). If a field of view is configured, a
/// packet may span the blind sector: columns after it are later by the columns skipped. In dual mode two equal
/// distances are one return.
///
/// Single owner, not thread-safe. Allocates nothing, throws nothing. A rejected packet leaves the decoder unchanged,
/// except for the model recognition and unknown_packets().
class Decoder {
 public:
  explicit Decoder(const DecoderOptions& options = {}) : options_(options) {}

  /// Fills all of `packet` except `lidar` and `stamp`. Returns the reason for rejection (length, model, flag,
  /// azimuth), if any; `packet` is then undefined.
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Model as which packets are decoded; empty before the first good packet. The same applies to the next.
  [[nodiscard]] std::optional<Model> model() const { return model_; }
  [[nodiscard]] std::optional<ReturnMode> return_mode() const { return mode_; }
  [[nodiscard]] Pace pace() const { return pace_; }

  /// Model that the packets report, according to ModelRecognition; differs from model() if the options override it.
  /// Empty while the product ID is unknown.
  [[nodiscard]] std::optional<Model> recognised_model() const { return recognised_; }

  /// Packets rejected for their factory bytes, with the most frequent product ID; empty if there are none.
  [[nodiscard]] std::optional<UnknownPackets> unknown_packets() const;

  /// Time of the first firing of the last good packet, past the hour of the lidar's clock: [0, 1 h).
  [[nodiscard]] Duration time_of_hour() const { return time_of_hour_; }

  /// Rotation rate of the last good packet, from the turn of its columns.
  [[nodiscard]] double rotation_rate_rpm() const;

 private:
  using Packet = std::span<const std::byte, kDataPacketBytes>;
  /// Adds corrections of range and beam origin; most occur in calibration files only.
  struct Firings : SpinningBeams {
    PerFiring<float> range_offset_m, radial_offset_m, lateral_offset_m, vertical_offset_m;
    PerFiring<std::uint8_t> laser;
  };
  using Distances = FiringGroup::PerLaser<std::int32_t>; ///< same width as the other data, to vectorise

  std::optional<PacketError> recognise(Packet packet, Duration stamp);
  PacketError refuse_unknown(Packet packet);
  void prepare(Model model, ReturnMode mode, Pace pace, const Calibration& calibration);
  [[nodiscard]] std::optional<PacketError> check_blocks(Packet packet) const;
  bool measure_turns(Packet packet, Duration stamp);
  void measure_turn_since_last_packet(Duration stamp, double max_turn_cdeg);
  void read_firing_groups(Packet packet, std::size_t column, std::size_t first_firing, LidarPacket& out) const;
  void place(const Distances& distances, const Distances& previous, const Aim& aim, std::size_t column,
             std::size_t first_firing, FiringGroup& group) const;

  DecoderOptions options_;
  ModelRecognition recognition_;
  PaceRecognition pace_recognition_;
  std::optional<Duration> last_recognised_; ///< stamp of the previous packet, good or not
  std::optional<Model> recognised_;
  std::array<UnknownPackets, 256> unknown_{}; ///< indexed by product ID
  std::optional<Model> model_;
  std::optional<ReturnMode> mode_;
  Pace pace_ = Pace::first;
  PacketLayout layout_{};
  Duration column_duration_{};
  float distance_resolution_m_ = 0.0F;
  Firings firings_{};

  std::array<std::uint16_t, kBlocks> azimuth_cdeg_{}; ///< indexed by column
  std::array<float, kBlocks> turn_cdeg_{};            ///< from each column to the next
  std::array<std::int32_t, kBlocks> column_offset_ns_{};
  ColumnAzimuth column_azimuth_; ///< current column
  Duration duration_{}, time_of_hour_{};
  float mean_turn_cdeg_ = 0.0F;
  std::optional<Duration> last_stamp_; ///< stamp of the packet of last_azimuth_cdeg_
  std::uint16_t last_azimuth_cdeg_ = 0;
};

} // namespace locus::velodyne
