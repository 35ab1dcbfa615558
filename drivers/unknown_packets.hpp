// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "drivers/velodyne/decoder.hpp"

namespace locus {

/// What packets of no model that can be read say of themselves.
struct UnknownPackets : velodyne::UnknownPackets {
  std::string_view hesai{}; ///< the maker's name of the model; empty: they are of a Velodyne. Lives for ever
  bool is_readable = false; ///< the model is, but the lidar is configured as another, or sends in a mode of no manual
};

/// "product id 0x31 and return mode 0x37 in 120 packets", "a Hesai AT128 in 120 packets".
std::string to_string(const UnknownPackets& unknown);

} // namespace locus
