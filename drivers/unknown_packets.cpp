// SPDX-License-Identifier: Apache-2.0
#include "drivers/unknown_packets.hpp"

#include <fmt/format.h>

namespace locus {

std::string to_string(const UnknownPackets& unknown) {
  if (unknown.hesai.empty())
    return velodyne::to_string(static_cast<const velodyne::UnknownPackets&>(unknown));
  return fmt::format("a Hesai {} in {} packets", unknown.hesai, unknown.packets);
}

} // namespace locus
