// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/stamp.hpp"

namespace locus::hesai {

/// Supported sensor models; the maker also calls some of them PandarQT, PandarXT-16, PandarXT-32, XT32M2X and QT128C2X.
enum class Model : std::uint8_t { pandar40p, pandar64, qt64, xt16, xt32, xt32m, qt128, ot128 };
constexpr auto names_of(Model) {
  return std::to_array<std::string_view>({"Pandar40P", "Pandar64", "QT64", "XT16", "XT32", "XT32M", "QT128", "OT128"});
}
inline constexpr std::size_t kModels = names_of(Model{}).size();

inline constexpr std::uint16_t kCdegPerTurn = 36000;
inline constexpr std::size_t kMaxChannels = 128;
inline constexpr std::size_t kMaxBlocks = 10;

/// Direction of one laser: from the table of its manual, or from a unit's calibration file.
struct Laser {
  double elevation_rad = 0.0;
  double azimuth_offset_rad = 0.0; ///< added to the azimuth of the block, clockwise seen from above
  std::uint8_t ring = 0;           ///< 0 is the lowest laser, counted upwards
};

/// Laser angles, by channel.
struct Calibration {
  std::size_t laser_count = 0;
  std::array<Laser, kMaxChannels> storage;

  [[nodiscard]] std::span<const Laser> lasers() const { return {storage.data(), laser_count}; }

  /// Numbers the rings by elevation. Call after all elevations are set.
  void assign_rings();
};

/// Firing times of the lasers of a column, relative to the instant of its block's azimuth. Values of channels that do
/// not fire in this sequence are arbitrary, since they have no returns.
struct FiringSequence {
  Duration column_duration{}; ///< from one column to the next
  std::array<std::int32_t, kMaxChannels> offset_ns{};
  std::uint8_t silent_banks = 0; ///< bit mask of banks of sixteen channels that do not fire; skipped if all zero
};

/// Source of the sequence of a block, of at most two.
enum class SequenceFrom : std::uint8_t {
  only_one,
  mode_flag,         ///< tail field: odd selects the first sequence for the first column; columns alternate
  operational_state, ///< tail field: 0 is high resolution, the second sequence
};

/// Offsets in bytes from the start of the tail.
struct TailLayout {
  std::size_t return_mode, motor_speed, date, time;
  std::size_t bytes; ///< length; a sequence number may follow
};

/// Layout of a data packet, all in bytes: a header, blocks of an azimuth and the channels (distance, reflectivity, and
/// with four bytes, confidence), and a tail. All integers are little-endian.
struct PacketLayout {
  std::size_t header;       ///< 0, 8 (start, sizes) or 12 (start, protocol version, sizes, flags)
  std::size_t block_header; ///< ends with two bytes of azimuth
  std::size_t channel;
  std::size_t channels, blocks;
  bool has_checksums; ///< CRCs after the blocks and after the tail; header flags announce the fields in between
  TailLayout tail;

  [[nodiscard]] std::size_t block() const { return block_header + channels * channel; }
  [[nodiscard]] std::size_t body() const { return header + blocks * block(); } ///< end of the blocks
};

/// Data of a model from its manual. Packets consist of *columns*: all firings that share one reported azimuth. A column
/// is one block, or one block for each return.
struct ModelSpec {
  std::array<std::uint8_t, 2> version; ///< protocol version, in a header of 12 bytes
  PacketLayout layout;
  std::array<std::size_t, 4> lengths; ///< packet lengths with the usual flags; 0: unused

  bool time_of_last_column;   ///< the packet's time refers to its last column instead of its first
  Duration azimuth_delay;     ///< from that time to the instant of the column's azimuth
  float least_range_m;        ///< specified minimum range; nearer returns are discarded
  SequenceFrom sequence_from; ///< selects one of `sequences`
  std::array<FiringSequence, 2> sequences;
  Calibration calibration;
};

/// Returns the data of a model. Thread-safe.
const ModelSpec& spec(Model model);

/// Echoes of a laser pulse that a packet reports.
enum class ReturnMode : std::uint8_t { first, second, strongest, last, dual, triple };
constexpr auto names_of(ReturnMode) {
  return std::to_array<std::string_view>({"first", "second", "strongest", "last", "dual", "triple"});
}
constexpr std::size_t returns_of(ReturnMode mode) {
  return mode == ReturnMode::triple ? 3 : mode == ReturnMode::dual ? 2 : 1;
}
/// Converts the byte in the tail. All pairs of returns map to `dual`, since their kinds do not matter here.
std::optional<ReturnMode> return_mode_from_byte(std::uint8_t byte);

/// Time from one packet to the next.
Duration packet_duration(Model model, ReturnMode mode, std::size_t sequence = 0);

/// Model of a packet, recognised by its header.
struct Looks {
  std::string_view name;      ///< e.g. "XT32"; for an unsupported model the maker's name, e.g. "AT128"
  std::optional<Model> model; ///< decodable model, if supported
};

/// Recognises a Hesai data packet; empty if it is not one. Packets of newer protocols start with EE FF and a version;
/// those of a Pandar40 have no header, but each block starts with FF EE.
std::optional<Looks> look_at(std::span<const std::byte> payload);

/// Returns true if a packet has the layout of a model, by its header or, if there is none, by its first block flag and
/// its length. The length of packets with a header is checked by parts_of().
bool has_layout_of(Model model, std::span<const std::byte> payload);

} // namespace locus::hesai
