// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace locus {

/// Returns the key of the voxel of `side_m` around a position, 21 bits per axis. Keys repeat beyond 2^20 voxels from
/// the origin.
inline std::uint64_t voxel_key(const Eigen::Vector3f& position, float side_m) {
  constexpr std::uint64_t kAxis = (1U << 21U) - 1;
  const auto axis = [&](float value) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(value / side_m))) & kAxis;
  };
  return axis(position.x()) << 42U | axis(position.y()) << 21U | axis(position.z());
}

} // namespace locus
