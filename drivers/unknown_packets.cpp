// SPDX-License-Identifier: Apache-2.0
#include "drivers/unknown_packets.hpp"

#include <fmt/format.h>

namespace locus {

std::string to_string(const UnknownPackets& unknown) {
  if (!unknown.maker)
    return velodyne::to_string(static_cast<const velodyne::UnknownPackets&>(unknown));
  return fmt::format("{} {}{}{} in {} packets", unknown.maker == OtherMaker::ouster ? "an" : "a",
                     to_string(*unknown.maker), unknown.model.empty() ? "" : " ", unknown.model, unknown.packets);
}

std::string_view remedy(const UnknownPackets& unknown) {
  if (!unknown.maker || unknown.is_readable)
    return "";
  if (unknown.maker == OtherMaker::ouster)
    return "it is read with its metadata: locusctl fetch SENSOR -o FILE, then model: Ouster, metadata: FILE";
  return "there is no decoder for it: use the clouds of its driver (key topic)";
}

} // namespace locus
