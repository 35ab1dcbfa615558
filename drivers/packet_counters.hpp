// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Reason why a datagram was rejected. Each has a counter in PacketCounters::rejected.
enum class PacketError : std::uint8_t {
  length,    ///< not the length of any packet of this lidar
  flag,      ///< block without the flag of the model; Ouster: no valid column, or another packet type
  model,     ///< unknown product ID or return mode, a calibration file for another number of lasers, or a metadata file
             ///< from before the sensor was restarted
  sender,    ///< not from a configured lidar
  azimuth,   ///< above 360 degrees, or a turn that no motor makes
  time,      ///< impossible time of hour, or far from the expected time of the sensor's clock
  duplicate, ///< packet received before
  truncated, ///< incomplete payload
  checksum,  ///< wrong checksum
};
constexpr auto names_of(PacketError) {
  return std::to_array<std::string_view>(
      {"length", "flag", "model", "sender", "azimuth", "time", "duplicate", "truncated", "checksum"});
}
inline constexpr std::size_t kPacketErrorCount = names_of(PacketError{}).size();

/// Counters of the datagrams of one lidar, or of all: received = data + position + sum of rejected.
struct PacketCounters {
  std::uint64_t received = 0;
  std::uint64_t data = 0;
  std::uint64_t position = 0;
  std::uint64_t lost = 0;        ///< not received: gaps in the numbers, or in stamp and azimuth
  std::uint64_t reordered = 0;   ///< received after a later one; included in `data`, since they are used
  std::uint64_t clock_steps = 0; ///< steps of the sensor's clock relative to the host's
  std::array<std::uint64_t, kPacketErrorCount> rejected{};

  std::uint64_t& operator[](PacketError error) { return rejected[static_cast<std::size_t>(error)]; }
  std::uint64_t operator[](PacketError error) const { return rejected[static_cast<std::size_t>(error)]; }
  PacketCounters& operator+=(const PacketCounters& other);

  bool operator==(const PacketCounters&) const = default;
};

} // namespace locus
