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

/// What a GPS receiver says of itself in an NMEA RMC sentence.
struct RmcSentence {
  bool valid = false; ///< status A: the receiver has a fix
  Duration time_of_day{};
  std::optional<std::chrono::year_month_day> date;
  std::optional<double> speed_mps;
  std::optional<double> course_deg; ///< clockwise from true north
};

/// Reads $GPRMC (or $GNRMC, of receivers with several systems). Nothing unless the checksum is there and right. Never
/// fails on garbage.
std::optional<RmcSentence> parse_rmc(std::string_view sentence);

/// Pulse per second, as the sensor sees it.
enum class PpsState : std::uint8_t { absent = 0, synchronizing = 1, locked = 2, error = 3 };
constexpr auto names_of(PpsState) {
  return std::to_array<std::string_view>({"absent", "synchronizing", "locked", "error"});
}
using locus::to_string;

/// Position ("telemetry") packet: how well the sensor knows the time.
struct PositionPacket {
  Duration time_of_hour{};
  PpsState pps = PpsState::absent;
  std::optional<RmcSentence> rmc;

  /// The sensor's time of hour is that of UTC.
  [[nodiscard]] bool is_synchronised() const { return pps == PpsState::locked && rmc && rmc->valid; }
};

/// Any bytes of the right length are a position packet; what they say may be nothing. Sensors without the PPS byte
/// (early HDL-32E) leave it 0.
PositionPacket parse_position_packet(std::span<const std::byte, kPositionPacketBytes> payload);

} // namespace locus::velodyne
