// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>

#include "core/ingest/lidar_packet.hpp"

/// Common parts of spinning lidars whose packets give one azimuth per column of firings: Velodyne and Hesai.
namespace locus {

/// Constant geometry of the lasers of a column, by firing. One array per quantity, so that loops over the firings
/// vectorise.
struct SpinningBeams {
  template <class T> using PerFiring = std::array<T, LidarPacket::kMaxLasers>;

  PerFiring<float> share_of_column; ///< time from the column's azimuth to the firing / duration of the column
  PerFiring<float> cos_azimuth_offset, sin_azimuth_offset;
  PerFiring<float> cos_elevation, sin_elevation;
  PerFiring<std::int32_t> offset_ns;
  PerFiring<std::uint8_t> ring;

  void point(std::size_t firing, double elevation_rad, double azimuth_offset_rad) {
    cos_azimuth_offset[firing] = static_cast<float>(std::cos(azimuth_offset_rad));
    sin_azimuth_offset[firing] = static_cast<float>(std::sin(azimuth_offset_rad));
    cos_elevation[firing] = static_cast<float>(std::cos(elevation_rad));
    sin_elevation[firing] = static_cast<float>(std::sin(elevation_rad));
  }
};

/// Directions of the lasers of a firing group at their firing times, clockwise from azimuth 0.
struct Aim {
  FiringGroup::PerLaser<float> cos_azimuth, sin_azimuth;
};

/// Azimuth of a column, clockwise.
struct ColumnAzimuth {
  float cos = 1.0F, sin = 0.0F;
  float turn_rad = 0.0F; ///< rotation during the column
};

/// Rotates the column's azimuth by each firing's share of the turn (first, a small angle) and by its laser's offset.
[[gnu::always_inline]] inline Aim aim_at(const SpinningBeams& beams, const ColumnAzimuth& column,
                                         std::size_t first_firing) {
  Aim aim;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::size_t i = first_firing + k;
    const float angle = beams.share_of_column[i] * column.turn_rad;
    const float cos_angle = 1.0F - 0.5F * angle * angle; // at most 1.6 deg: the next terms are below 3e-8
    const float sin_angle = angle - angle * angle * angle / 6.0F;
    const float cos_firing = column.cos * cos_angle - column.sin * sin_angle;
    const float sin_firing = column.sin * cos_angle + column.cos * sin_angle;
    aim.cos_azimuth[k] = cos_firing * beams.cos_azimuth_offset[i] - sin_firing * beams.sin_azimuth_offset[i];
    aim.sin_azimuth[k] = sin_firing * beams.cos_azimuth_offset[i] + cos_firing * beams.sin_azimuth_offset[i];
  }
  return aim;
}

/// Numbers lasers by elevation; ring 0 is the lowest. Equal elevations keep their order.
template <class Laser> void number_rings(std::span<Laser> lasers) {
  std::array<std::uint8_t, LidarPacket::kMaxLasers> upwards;
  const auto end = upwards.begin() + static_cast<std::ptrdiff_t>(lasers.size());
  std::iota(upwards.begin(), end, std::uint8_t{0});
  std::stable_sort(upwards.begin(), end,
                   [&](std::uint8_t a, std::uint8_t b) { return lasers[a].elevation_rad < lasers[b].elevation_rad; });
  for (std::size_t ring = 0; ring < lasers.size(); ++ring)
    lasers[upwards[ring]].ring = static_cast<std::uint8_t>(ring);
}

} // namespace locus
