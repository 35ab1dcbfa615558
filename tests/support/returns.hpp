// SPDX-License-Identifier: Apache-2.0
#pragma once

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

} // namespace locus::test
