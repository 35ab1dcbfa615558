// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/names.hpp"

namespace locus {

/// Why a datagram was not turned into data. Each has its counter in PacketCounters::rejected.
enum class PacketError : std::uint8_t {
  length,    ///< of no packet that the lidar sends
  flag,      ///< a block that does not open as the model's blocks do; of an Ouster, nothing measured or another type
  model,     ///< unknown product id or return mode, a calibration file for another number of lasers, or a metadata file
             ///< from before the sensor was started anew
  sender,    ///< not from a lidar that was asked for
  azimuth,   ///< beyond 360 degrees, or a turn that no motor makes
  time,      ///< an impossible time of hour, or one far from where the sensor's clock should be
  duplicate, ///< a packet that was already there
  truncated, ///< part of the payload is missing
  checksum,  ///< that of the packet is wrong
};
constexpr auto names_of(PacketError) {
  return std::to_array<std::string_view>(
      {"length", "flag", "model", "sender", "azimuth", "time", "duplicate", "truncated", "checksum"});
}
inline constexpr std::size_t kPacketErrorCount = names_of(PacketError{}).size();

/// What became of the datagrams of one lidar, or of all: received = data + position + the sum of rejected.
struct PacketCounters {
  std::uint64_t received = 0;
  std::uint64_t data = 0;
  std::uint64_t position = 0;
  std::uint64_t lost = 0;        ///< never came: gaps in stamp and azimuth
  std::uint64_t reordered = 0;   ///< came after a later one; among data, for they are used all the same
  std::uint64_t clock_steps = 0; ///< of the sensor's clock against that of the host
  std::array<std::uint64_t, kPacketErrorCount> rejected{};

  std::uint64_t& operator[](PacketError error) { return rejected[static_cast<std::size_t>(error)]; }
  std::uint64_t operator[](PacketError error) const { return rejected[static_cast<std::size_t>(error)]; }
  PacketCounters& operator+=(const PacketCounters& other);

  bool operator==(const PacketCounters&) const = default;
};

} // namespace locus
