// SPDX-License-Identifier: Apache-2.0
#include "drivers/recent_packets.hpp"

#include <algorithm>
#include <cstring>

namespace locus {

bool RecentPackets::contains(std::span<const std::byte> payload) const {
  const std::size_t bytes = std::min(payload.size(), std::tuple_size_v<Beginning>);
  return std::ranges::any_of(std::span{packets_}.first(std::min(count_, packets_.size())),
                             [&](const Beginning& one) { return std::memcmp(one.data(), payload.data(), bytes) == 0; });
}

void RecentPackets::add(std::span<const std::byte> payload) {
  std::memcpy(packets_[count_ % packets_.size()].data(), payload.data(),
              std::min(payload.size(), std::tuple_size_v<Beginning>));
  ++count_;
}

} // namespace locus
