// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "drivers/velodyne/decoder.hpp"

namespace locus {

/// Description of packets that cannot be decoded.
struct UnknownPackets : velodyne::UnknownPackets {
  std::string_view hesai{}; ///< the maker's name of the model, static lifetime; empty: Velodyne packets
  bool is_readable = false; ///< supported model, but the lidar is configured as another, or its mode is undocumented
};

/// Returns for example "product id 0x31 and return mode 0x37 in 120 packets" or "a Hesai AT128 in 120 packets".
std::string to_string(const UnknownPackets& unknown);

} // namespace locus
