// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_counters.hpp"

namespace locus {

PacketCounters& PacketCounters::operator+=(const PacketCounters& other) {
  received += other.received;
  data += other.data;
  position += other.position;
  lost += other.lost;
  reordered += other.reordered;
  clock_steps += other.clock_steps;
  for (std::size_t i = 0; i < rejected.size(); ++i)
    rejected[i] += other.rejected[i];
  return *this;
}

} // namespace locus
