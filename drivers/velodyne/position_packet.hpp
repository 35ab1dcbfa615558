// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/names.hpp"
#include "core/base/stamp.hpp"

namespace locus::velodyne {

inline constexpr std::size_t kPositionPacketBytes = 512;
inline constexpr std::size_t kTimeOfHourOffset = 0xC6; ///< microseconds past the hour, 32 bits

/// Data of a GPS receiver from an NMEA RMC sentence.
struct RmcSentence {
  bool valid = false; ///< status A: the receiver has a fix
  Duration time_of_day{};
  std::optional<std::chrono::year_month_day> date;
  std::optional<double> speed_mps;
  std::optional<double> course_deg; ///< clockwise from true north
};

/// Content of the NMEA text of a position packet, from the least to the most useful.
enum class Nmea : std::uint8_t { none, no_rmc, no_checksum, wrong_checksum, no_time, no_fix, good };

/// Best RMC sentence of a text.
struct NmeaText {
  Nmea state = Nmea::none;
  std::optional<RmcSentence> rmc; ///< set for no_fix and good
};

/// Finds the RMC sentence of any talker in a text that may begin in the middle of another sentence and hold several.
/// Safe for arbitrary input.
NmeaText parse_nmea(std::string_view text);

/// State of the pulse per second, as reported by the sensor.
enum class PpsState : std::uint8_t { absent = 0, synchronizing = 1, locked = 2, error = 3 };
constexpr auto names_of(PpsState) {
  return std::to_array<std::string_view>({"absent", "synchronizing", "locked", "error"});
}
using locus::to_string;

/// Position ("telemetry") packet: time synchronisation of the sensor.
struct PositionPacket {
  Duration time_of_hour{};
  PpsState pps = PpsState::absent;
  Nmea nmea = Nmea::none;
  std::optional<RmcSentence> rmc;

  /// Returns true if the sensor's time of hour is UTC.
  [[nodiscard]] bool is_synchronised() const { return pps == PpsState::locked && rmc && rmc->valid; }
};

/// Says for the user why the time of a lidar with a locked PPS is not used; empty if it is, or if PPS is not locked.
/// The text has static lifetime.
std::string_view why_unused(const PositionPacket& packet);

/// Parses a position packet from any bytes of the right length; its content may be meaningless. Sensors without the PPS
/// byte (early HDL-32E) leave it 0.
PositionPacket parse_position_packet(std::span<const std::byte, kPositionPacketBytes> payload);

} // namespace locus::velodyne
