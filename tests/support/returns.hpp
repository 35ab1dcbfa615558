// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "core/ingest/lidar_packet.hpp"

namespace locus::test {

/// Returns the valid returns of a packet, firing group by firing group.
inline std::vector<LidarReturn> returns_of(const LidarPacket& packet) {
  std::vector<LidarReturn> returns;
  for (const FiringGroup& group : packet.firing_groups())
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
      if (group.range_m[k] > 0.0F)
        returns.push_back(group[k]);
  return returns;
}

/// Returns the number of valid returns of a packet.
inline std::size_t count_returns(const LidarPacket& packet) {
  std::size_t returns = 0;
  for (const FiringGroup& group : packet.firing_groups())
    for (const float range_m : group.range_m)
      returns += range_m > 0.0F ? 1 : 0;
  return returns;
}

} // namespace locus::test
