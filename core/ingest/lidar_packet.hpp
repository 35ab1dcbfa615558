// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/stamp.hpp"

namespace locus {

/// One return of one laser, in the frame of its lidar: x is azimuth 0, y left, z up.
struct LidarReturn {
  float x_m, y_m, z_m;
  float range_m; ///< as measured, > 0
  std::int32_t
      offset_ns;     ///< time of firing after LidarPacket::stamp; may be negative for lasers fired ahead of the first
  std::uint8_t ring; ///< 0 is the lowest laser of the model, counted upwards
  std::uint8_t intensity;
};

/// What sixteen lasers of one lidar saw that fired one upon the other, at most one return of each. One array per figure
/// makes the work on them vector instructions.
struct FiringGroup {
  static constexpr std::size_t kLasers = 16;
  template <class T> using PerLaser = std::array<T, kLasers>;

  std::uint8_t first_laser = 0; ///< of the lidar, a multiple of 16; the others follow it
  PerLaser<float> x_m, y_m, z_m;
  PerLaser<float> range_m; ///< 0 where there was no return
  PerLaser<std::int32_t> offset_ns;
  PerLaser<std::uint8_t> ring, intensity;

  [[nodiscard]] LidarReturn operator[](std::size_t i) const {
    return {x_m[i], y_m[i], z_m[i], range_m[i], offset_ns[i], ring[i], intensity[i]};
  }
};

/// The returns of one data packet, in the order in which they were fired. Plain memory, reused from packet to packet:
/// decoding allocates nothing.
struct LidarPacket {
  static constexpr std::size_t kMaxFiringGroups = 256; ///< 16 columns of 128 lasers with two returns each
  static constexpr std::size_t kMaxReturns = kMaxFiringGroups * FiringGroup::kLasers;
  static constexpr std::size_t kMaxLasers = 128;

  /// What came as a whole and is given out in slices: from its first firing to behind its last one.
  struct Cloud {
    Stamp begin, end;
    bool ends_here = false; ///< with this slice
  };

  std::uint8_t lidar = 0;               ///< index in the configuration
  Stamp stamp;                          ///< of the first firing
  Duration duration{};                  ///< from the first firing to the one after the last
  std::uint16_t first_azimuth_cdeg = 0; ///< of the first firing, whether or not it has returns
  std::optional<Cloud> cloud;           ///< that it is a slice of; nothing for one that was sent when it was fired
  std::size_t count = 0;                ///< of the firing groups
  std::array<FiringGroup, kMaxFiringGroups> storage;

  [[nodiscard]] std::span<const FiringGroup> firing_groups() const { return {storage.data(), count}; }
};

} // namespace locus
