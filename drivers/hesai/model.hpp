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

/// The sensors whose packets are understood; the maker calls some of them PandarQT, PandarXT-16, PandarXT-32, XT32M2X
/// and QT128C2X.
enum class Model : std::uint8_t { pandar40p, pandar64, qt64, xt16, xt32, xt32m, qt128, ot128 };
constexpr auto names_of(Model) {
  return std::to_array<std::string_view>({"Pandar40P", "Pandar64", "QT64", "XT16", "XT32", "XT32M", "QT128", "OT128"});
}
inline constexpr std::size_t kModels = names_of(Model{}).size();

inline constexpr std::uint16_t kCdegPerTurn = 36000;
inline constexpr std::size_t kMaxChannels = 128;
inline constexpr std::size_t kMaxBlocks = 10;

/// Where one laser points: the table of its manual, or of the file of one unit.
struct Laser {
  double elevation_rad = 0.0;
  double azimuth_offset_rad = 0.0; ///< added to the azimuth of the block, clockwise seen from above
  std::uint8_t ring = 0;           ///< 0 is the lowest laser, counted upwards
};

/// By channel.
struct Calibration {
  std::size_t laser_count = 0;
  std::array<Laser, kMaxChannels> storage;

  [[nodiscard]] std::span<const Laser> lasers() const { return {storage.data(), laser_count}; }

  /// Numbers the rings by elevation. To be called once all elevations stand.
  void assign_rings();
};

/// When the lasers of a column fire, after the instant that the azimuth of its block is of. A channel that does not
/// fire in this sequence has any value: it has no return either.
struct FiringSequence {
  Duration column_duration{}; ///< from a column to the next
  std::array<std::int32_t, kMaxChannels> offset_ns{};
  std::uint8_t silent_banks =
      0; ///< a bit for each sixteen channels of which none fires: if all is 0, they are left out
};

/// Two sequences at most, and what says which of them a block is of.
enum class SequenceFrom : std::uint8_t {
  only_one,
  mode_flag,         ///< of the tail: odd is the first; with one return it is that of the first column, and so on
  operational_state, ///< of the tail: 0 is high resolution, the second sequence
};

/// Offsets in bytes from the begin of the tail.
struct TailLayout {
  std::size_t return_mode, motor_speed, date, time;
  std::size_t bytes; ///< behind it there may be a sequence number
};

/// Places in a data packet, all in bytes. It has a header, blocks of an azimuth and the channels (distance,
/// reflectivity, and of four bytes, confidence), and a tail. All integers are little-endian.
struct PacketLayout {
  std::size_t header;       ///< 0, 8 (start, sizes) or 12 (start, protocol version, sizes, flags)
  std::size_t block_header; ///< the azimuth is its last two
  std::size_t channel;
  std::size_t channels, blocks;
  bool has_checksums; ///< of the blocks and of the tail; between these are fields that the header's flags tell of
  TailLayout tail;

  [[nodiscard]] std::size_t block() const { return block_header + channels * channel; }
  [[nodiscard]] std::size_t body() const { return header + blocks * block(); } ///< where the blocks end
};

/// What the manual says about a model. Its packets are made of *columns*: all firings that share one reported azimuth.
/// A column is one block, in a mode with several returns as many as these.
struct ModelSpec {
  std::array<std::uint8_t, 2> version; ///< of the protocol, in a header of 12 bytes
  PacketLayout layout;
  std::array<std::size_t, 4> lengths; ///< that its packets have with the flags that are usual; 0: none

  bool time_of_last_column;   ///< the time in the packet tells of its last column, else of its first
  Duration azimuth_delay;     ///< from that time to the instant of the column's azimuth
  float least_range_m;        ///< that it is specified for; what is nearer is none
  SequenceFrom sequence_from; ///< which of these
  std::array<FiringSequence, 2> sequences;
  Calibration calibration;
};

/// The manual's figures of a model. Any thread.
const ModelSpec& spec(Model model);

/// Which of the echoes of a laser pulse a packet reports.
enum class ReturnMode : std::uint8_t { first, second, strongest, last, dual, triple };
constexpr auto names_of(ReturnMode) {
  return std::to_array<std::string_view>({"first", "second", "strongest", "last", "dual", "triple"});
}
constexpr std::size_t returns_of(ReturnMode mode) {
  return mode == ReturnMode::triple ? 3 : mode == ReturnMode::dual ? 2 : 1;
}
/// Of the byte in the tail. All pairs of returns are dual: which they are does not matter here.
std::optional<ReturnMode> return_mode_from_byte(std::uint8_t byte);

/// Time from a packet to the next.
Duration packet_duration(Model model, ReturnMode mode, std::size_t sequence = 0);

/// Whose packet something is by its looks.
struct Looks {
  std::string_view name;      ///< e.g. "XT32"; of a model that cannot be read the maker's, e.g. "AT128"
  std::optional<Model> model; ///< that it can be read as
};

/// Nothing for what does not look like a data packet of Hesai: EE FF opens those of newer protocols, followed by the
/// version; those of a Pandar40 have no header, but each block begins with FF EE.
std::optional<Looks> look_at(std::span<const std::byte> payload);

/// Whether a packet has the layout of a model: its header says so, or the flags of its blocks. Its length is another
/// matter.
bool has_layout_of(Model model, std::span<const std::byte> payload);

} // namespace locus::hesai
