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

/// What the configuration knows better than the packets.
struct DecoderOptions {
  std::optional<Model> model = std::nullopt;             ///< nothing: told by ModelRecognition
  std::optional<ReturnMode> return_mode = std::nullopt;  ///< nothing: the packet's own factory byte
  std::optional<Calibration> calibration = std::nullopt; ///< nothing: the model's own table
  Isa isa = best_isa();
};

/// What packets of no known model, or in no known return mode, say of themselves.
struct UnknownPackets {
  std::uint8_t product_id = 0;  ///< the most frequent one
  std::uint8_t return_mode = 0; ///< of the latest packet that has it
  std::uint64_t packets = 0;    ///< that have it
};

/// "product id 0x31 and return mode 0x37 in 120 packets".
std::string to_string(const UnknownPackets& unknown);

/// Turns data packets into returns, each with the direction and the time of its own firing.
///
/// The azimuth of a firing is that of its column plus the share of the turn to the next column that had passed when it
/// fired. After the last column the mean turn of the packet's columns counts; a dual packet of the VLS-128, one column
/// long, counts the turn since the packet before, the first one none. Where a field of view was set, a packet may hold
/// the columns before and behind the blind sector: those behind it are later by the columns that it would have taken.
/// In dual mode two equal distances are one return.
///
/// One owner. Allocates nothing, throws nothing. A packet that is refused leaves the decoder as it was, but for what
/// the model is recognised by and for unknown_packets().
class Decoder {
 public:
  explicit Decoder(const DecoderOptions& options = {}) : options_(options) {}

  /// Fills everything of `packet` but lidar and stamp, or says why not (length, model, flag, azimuth, time) and leaves
  /// `packet` undefined.
  std::optional<PacketError> decode(std::span<const std::byte> payload, LidarPacket& packet);

  /// Of the packets so far; nothing before the first good one.
  [[nodiscard]] std::optional<Model> model() const { return model_; }
  [[nodiscard]] std::optional<ReturnMode> return_mode() const { return mode_; }
  [[nodiscard]] Pace pace() const { return pace_; }

  /// What the packets say they come from, by ModelRecognition; another than model() where the options say otherwise.
  /// Nothing while their product id is unknown.
  [[nodiscard]] std::optional<Model> recognised_model() const { return recognised_; }

  /// Of the packets that were refused for their factory bytes, those of the most frequent product id; nothing without
  /// any.
  [[nodiscard]] std::optional<UnknownPackets> unknown_packets() const;

  /// Of the last good packet: when its first firing was, past the hour of the lidar's clock. 0 <= it < 1 h.
  [[nodiscard]] Duration time_of_hour() const { return time_of_hour_; }

  /// Of the last good packet, from the turn of its columns.
  [[nodiscard]] double rotation_rate_rpm() const;

 private:
  using Packet = std::span<const std::byte, kDataPacketBytes>;
  /// Adds what only a calibration file of a unit may have.
  struct Firings : SpinningBeams {
    PerFiring<float> range_offset_m, radial_offset_m, lateral_offset_m, vertical_offset_m;
    PerFiring<std::uint8_t> laser;
  };
  using Distances = FiringGroup::PerLaser<std::int32_t>; ///< as wide as all else about them

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
  std::optional<Duration> last_recognised_; ///< stamp of the packet before, good or not
  std::optional<Model> recognised_;
  std::array<UnknownPackets, 256> unknown_{}; ///< by product id
  std::optional<Model> model_;
  std::optional<ReturnMode> mode_;
  Pace pace_ = Pace::first;
  PacketLayout layout_{};
  Duration column_duration_{};
  float distance_resolution_m_ = 0.0F;
  Firings firings_{};

  std::array<std::uint16_t, kBlocks> azimuth_cdeg_{}; ///< per column
  std::array<float, kBlocks> turn_cdeg_{};            ///< from each column to the next
  std::array<std::int32_t, kBlocks> column_offset_ns_{};
  ColumnAzimuth column_azimuth_; ///< of the column at hand
  Duration duration_{}, time_of_hour_{};
  float mean_turn_cdeg_ = 0.0F;
  std::optional<Duration> last_stamp_; ///< of the packet that last_azimuth_cdeg_ is of
  std::uint16_t last_azimuth_cdeg_ = 0;
};

} // namespace locus::velodyne
