// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"

namespace locus {

/// Return of one laser, in the frame of its lidar: x is azimuth 0, y left, z up.
struct LidarReturn {
  float x_m, y_m, z_m;
  float range_m; ///< as measured, > 0
  std::int32_t
      offset_ns;     ///< time of firing after LidarPacket::stamp; may be negative for lasers fired ahead of the first
  std::uint8_t ring; ///< 0 is the lowest laser of the model, counted upwards
  std::uint8_t intensity;
};

/// Returns of sixteen lasers of one lidar that fire in one sequence, at most one per laser. One array per quantity
/// allows loops over them to be vectorised.
struct FiringGroup {
  static constexpr std::size_t kLasers = 16;
  template <class T> using PerLaser = std::array<T, kLasers>;

  std::uint8_t first_laser = 0; ///< index in the lidar, a multiple of 16; the others follow it
  PerLaser<float> x_m, y_m, z_m;
  PerLaser<float> range_m; ///< 0: no return
  PerLaser<std::int32_t> offset_ns;
  PerLaser<std::uint8_t> ring, intensity;

  [[nodiscard]] LidarReturn operator[](std::size_t i) const {
    return {x_m[i], y_m[i], z_m[i], range_m[i], offset_ns[i], ring[i], intensity[i]};
  }
};

/// Returns of one data packet, in firing order. Plain memory, reused from packet to packet: decoding allocates nothing.
struct LidarPacket {
  static constexpr std::size_t kMaxFiringGroups = 256; ///< 16 columns of 128 lasers with two returns each
  static constexpr std::size_t kMaxReturns = kMaxFiringGroups * FiringGroup::kLasers;
  static constexpr std::size_t kMaxLasers = 128;

  /// Cloud that arrived as a whole and is passed on in slices: from its first firing to just after its last one.
  struct Cloud {
    Stamp begin, end;
    bool ends_here = false; ///< this slice is the last one
  };

  std::uint8_t lidar = 0;               ///< index in the configuration
  Stamp stamp;                          ///< of the first firing
  Duration duration{};                  ///< from the first firing to the one after the last
  std::uint16_t first_azimuth_cdeg = 0; ///< of the first firing, even if it has no returns
  std::optional<Cloud> cloud;           ///< cloud of which this is a slice; nothing for a packet sent when fired
  std::size_t count = 0;                ///< number of firing groups
  std::array<FiringGroup, kMaxFiringGroups> storage;

  [[nodiscard]] std::span<const FiringGroup> firing_groups() const { return {storage.data(), count}; }
};

} // namespace locus
