// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/ingest/lidar_packet.hpp"

namespace locus::test {

/// The returns of a packet one by one, salvo by salvo; firings without one are left out.
inline std::vector<LidarReturn> returns_of(const LidarPacket& packet) {
  std::vector<LidarReturn> returns;
  for (const Salvo& salvo : packet.salvos())
    for (std::size_t k = 0; k < Salvo::kLasers; ++k)
      if (salvo.range_m[k] > 0.0F)
        returns.push_back(salvo[k]);
  return returns;
}

} // namespace locus::test
