// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace locus::tools {

/// Maps a unit normal to two bytes, of which 127 is 1: its place in the octahedral square, into whose corners the lower
/// half of the octahedron is folded. Decoded by tools/locus_replay/report/octahedral.js.
inline std::array<std::uint8_t, 2> octahedral(const Eigen::Vector3f& normal) {
  const auto bytes = [](float u, float v) {
    const auto byte = [](float part) {
      return static_cast<std::uint8_t>(static_cast<std::int8_t>(std::lround(127.0F * part)));
    };
    return std::array{byte(u), byte(v)};
  };
  const float reach = normal.lpNorm<1>();
  if (!(reach > 0.0F))
    return bytes(0, 0);
  const float u = normal.x() / reach, v = normal.y() / reach;
  if (normal.z() >= 0.0F)
    return bytes(u, v);
  return bytes(std::copysign(1.0F - std::abs(v), u), std::copysign(1.0F - std::abs(u), v));
}

} // namespace locus::tools
