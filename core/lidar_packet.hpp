// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/stamp.hpp"

namespace locus {

/// One return of one laser, in the frame of its lidar: x is azimuth 0, y left, z up.
struct LidarReturn {
  float x_m, y_m, z_m;
  float range_m; ///< as measured, > 0
  std::int32_t
      offset_ns; ///< time of firing after LidarPacket::stamp; may be negative for lasers fired ahead of the first
  std::uint16_t azimuth_cdeg; ///< of the firing, 0..35999, clockwise seen from above
  std::uint8_t ring;          ///< 0 is the lowest laser of the model, counted upwards
  std::uint8_t intensity;
};

/// The returns of one data packet, in the order in which they were fired. Lasers without a return are left out.
/// Plain memory, reused from packet to packet: decoding allocates nothing.
struct LidarPacket {
  static constexpr std::size_t kMaxReturns = 384; ///< 12 blocks of 32 channels, whatever the model

  std::uint8_t lidar = 0;               ///< index in the configuration
  Stamp stamp;                          ///< of the first firing
  Duration duration{};                  ///< from the first firing to the one after the last
  std::uint16_t first_azimuth_cdeg = 0; ///< of the first firing, whether or not it has returns
  std::uint16_t last_azimuth_cdeg = 0;  ///< of the last firing
  std::size_t count = 0;
  std::array<LidarReturn, kMaxReturns> storage;

  [[nodiscard]] std::span<const LidarReturn> returns() const { return {storage.data(), count}; }
};

} // namespace locus
