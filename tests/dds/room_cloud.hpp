// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <vector>

/// A cloud of a static lidar with 128 rings in a room, as a driver publishes it: 130 048 points of 22 bytes, with
/// `time` in seconds since the header's stamp.
namespace locus::test::room_cloud {

struct Field {
  const char* name;
  std::uint32_t offset;
  std::uint8_t type; ///< numbers of sensor_msgs/PointField
};
inline constexpr std::array kFields{Field{"x", 0, 7},          Field{"y", 4, 7},     Field{"z", 8, 7},
                                    Field{"intensity", 12, 7}, Field{"ring", 16, 4}, Field{"time", 18, 7}};
inline constexpr std::uint32_t kColumns = 1016, kRings = 128, kPoints = kColumns * kRings, kStep = 22;

/// 8 x 6 m, floor 1 m below and ceiling 3 m above the lidar, which is one metre off the middle.
inline std::vector<std::uint8_t> points() {
  std::vector<std::uint8_t> bytes(std::size_t{kPoints} * kStep);
  std::uint8_t* at = bytes.data();
  for (std::uint32_t column = 0; column < kColumns; ++column) {
    const double share = static_cast<double>(column) / kColumns, azimuth = -2 * std::numbers::pi * share;
    for (std::uint16_t ring = 0; ring < kRings; ++ring, at += kStep) {
      const double elevation = (static_cast<double>(ring) - 64) * 0.35 * std::numbers::pi / 180;
      const std::array ray{std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                           std::sin(elevation)};
      constexpr std::array kLow{-3.0, -3.0, -1.0}, kHigh{5.0, 3.0, 3.0};
      double range_m = 1e9;
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (std::abs(ray[axis]) > 1e-9)
          range_m = std::min(range_m, (ray[axis] > 0 ? kHigh[axis] : kLow[axis]) / ray[axis]);
      const std::array<float, 4> xyzi{static_cast<float>(ray[0] * range_m), static_cast<float>(ray[1] * range_m),
                                      static_cast<float>(ray[2] * range_m), 50};
      const auto time_s = static_cast<float>(0.1 * share);
      std::memcpy(at, xyzi.data(), sizeof(xyzi));
      std::memcpy(at + 16, &ring, sizeof(ring));
      std::memcpy(at + 18, &time_s, sizeof(time_s));
    }
  }
  return bytes;
}

/// A point as Livox' driver publishes it.
struct LivoxPoint {
  std::uint32_t offset_ns = 0;
  std::array<float, 3> xyz_m{};
  std::uint8_t reflectivity = 0, line = 0;
};
inline constexpr std::uint32_t kLivoxColumnStep = 8, kLivoxPoints = kPoints / kLivoxColumnStep;

/// Every eighth column of the room, about as many points as a Livox sends in a tenth of a second.
inline std::vector<LivoxPoint> livox_points() {
  const std::vector<std::uint8_t> bytes = points();
  std::vector<LivoxPoint> livox(kLivoxPoints);
  for (std::uint32_t i = 0; i < kLivoxPoints; ++i) {
    const std::uint32_t ring = i % kRings, column = i / kRings * kLivoxColumnStep;
    const std::uint8_t* const from = bytes.data() + std::size_t{column * kRings + ring} * kStep;
    float time_s = 0.0F;
    std::memcpy(&time_s, from + 18, sizeof(time_s));
    std::memcpy(livox[i].xyz_m.data(), from, sizeof(livox[i].xyz_m));
    livox[i].offset_ns = static_cast<std::uint32_t>(1e9 * static_cast<double>(time_s));
    livox[i].reflectivity = 50;
    livox[i].line = static_cast<std::uint8_t>(ring);
  }
  return livox;
}

} // namespace locus::test::room_cloud
