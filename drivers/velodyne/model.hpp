// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/stamp.hpp"

namespace locus::velodyne {

/// Supported sensor models.
enum class Model : std::uint8_t { vlp16, puck_hi_res, vlp32c, hdl32e, vls128 };
inline constexpr std::array kModels{Model::vlp16, Model::puck_hi_res, Model::vlp32c, Model::hdl32e, Model::vls128};

/// Firing rate of a model. Only the VLS-128 has two: firmware 5.2.3.0 made it slower, and its packets do not report
/// that.
enum class Pace : std::uint8_t { first, slower };

/// Echoes of a laser pulse that a packet reports; the values are those of the first factory byte.
enum class ReturnMode : std::uint8_t { strongest = 0x37, last = 0x38, dual = 0x39 };

/// Layout of a data packet: blocks of (flag, azimuth, channels of (distance, intensity)), then the time of the first
/// firing in microseconds past the hour, then the return mode and the product ID. All integers are little-endian.
inline constexpr std::size_t kDataPacketBytes = 1206;
inline constexpr std::size_t kBlocks = 12;
inline constexpr std::size_t kChannels = 32;
inline constexpr std::size_t kChannelBytes = 3;
inline constexpr std::size_t kBlockHeaderBytes = 4;
inline constexpr std::size_t kBlockBytes = kBlockHeaderBytes + kChannels * kChannelBytes;
inline constexpr std::size_t kTimeOffset = kBlocks * kBlockBytes;
inline constexpr std::size_t kReturnModeOffset = kTimeOffset + 4;
inline constexpr std::size_t kProductIdOffset = kReturnModeOffset + 1;

inline constexpr std::uint16_t kCdegPerTurn = 36000;
inline constexpr std::size_t kMaxLasers = 128;
inline constexpr std::size_t kMaxBanks = 4;

/// Flags at the start of the blocks of the first, second, third and fourth 32 lasers.
inline constexpr std::array<std::uint16_t, kMaxBanks> kBankFlags{0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF};

/// Direction and origin of one beam. With azimuth a (clockwise, azimuth_offset included), elevation e and range r =
/// measured distance + range_offset, and c = r cos(e) + radial_offset, its return lies at
///   x = c cos(a) + lateral_offset sin(a),  y = -c sin(a) + lateral_offset cos(a),  z = r sin(e) + vertical_offset.
struct Laser {
  double elevation_rad = 0.0;
  double azimuth_offset_rad = 0.0; ///< added to the azimuth of the firing, clockwise seen from above
  double vertical_offset_m = 0.0;  ///< the only offset in built-in tables
  double radial_offset_m = 0.0;
  double lateral_offset_m = 0.0; ///< to the left
  double range_offset_m = 0.0;
  std::uint8_t ring = 0; ///< 0 is the lowest laser, counted upwards
};

/// Geometry of all lasers of one sensor: the table of its manual, or that of a unit's calibration file.
struct Calibration {
  std::size_t laser_count = 0;
  double distance_resolution_m = 0.0;
  std::array<Laser, kMaxLasers> storage;

  [[nodiscard]] std::span<const Laser> lasers() const { return {storage.data(), laser_count}; }

  /// Numbers the rings by elevation. Call after all elevations are set.
  void assign_rings();
};

/// Slot of a column: the laser that fires, and its delay after the first firing of the column.
struct Firing {
  std::int32_t offset_ns;
  std::uint8_t laser;
};

/// Data of a model from its manual. Packets consist of *columns*: all firings that share one reported azimuth. A column
/// is one block of 32 firings, or four blocks (banks) with 128 lasers; in dual return mode each block is doubled, the
/// last return before the strongest.
struct ModelSpec {
  std::string_view name;    ///< name in the configuration file
  std::uint8_t product_id;  ///< second factory byte
  std::size_t banks;        ///< blocks of 32 firings per column
  Duration column_duration; ///< from a column's first firing to that of the next
  Duration stamp_delay;     ///< from a packet's first firing to the instant of its time of hour
  std::array<Firing, kMaxLasers> storage;
  Calibration calibration;

  /// Firings of one column in channel order: 32 per bank.
  [[nodiscard]] std::span<const Firing> firings() const { return {storage.data(), banks * kChannels}; }
};

/// Returns the data of a model; `pace` is ignored for models with one pace. Thread-safe.
const ModelSpec& spec(Model model, Pace pace = Pace::first);

/// Returns true if units of both paces exist.
inline bool has_two_paces(Model model) { return model == Model::vls128; }

std::string_view to_string(Model model);
std::optional<Model> model_from_string(std::string_view name);
std::optional<Model> model_from_product_id(std::uint8_t product_id);

std::string_view to_string(ReturnMode mode);
std::optional<ReturnMode> return_mode_from_byte(std::uint8_t byte);

/// Division of the twelve blocks of a packet: `columns` times `banks` blocks, twice that in dual return mode. Only the
/// dual packets of the VLS-128 leave blocks (the last four) unused.
struct PacketLayout {
  std::size_t banks;   ///< per column
  std::size_t returns; ///< blocks that report the same firings: 1, or 2 in dual return mode
  std::size_t columns;

  [[nodiscard]] std::size_t blocks_per_column() const { return banks * returns; }
  [[nodiscard]] std::size_t used_blocks() const { return columns * blocks_per_column(); }
};
PacketLayout packet_layout(Model model, ReturnMode mode);

/// Time from the first firing of a packet to that of the next packet.
Duration packet_duration(Model model, ReturnMode mode, Pace pace = Pace::first);

} // namespace locus::velodyne
