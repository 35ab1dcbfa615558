// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "drivers/other_maker.hpp"
#include "drivers/velodyne/decoder.hpp"

namespace locus {

/// Description of packets that cannot be decoded.
struct UnknownPackets : velodyne::UnknownPackets {
  std::optional<OtherMaker> maker{}; ///< empty: Velodyne packets
  std::string_view model{};          ///< the maker's name, static lifetime; empty if the packets do not tell it
  bool is_readable = false; ///< supported model, but the lidar is configured as another, or its mode is undocumented
};

/// Returns for example "product id 0x31 and return mode 0x37 in 120 packets" or "a Hesai AT128 in 120 packets".
std::string to_string(const UnknownPackets& unknown);

/// Returns what the user can do to have these packets read; empty for Velodyne packets and supported models.
std::string_view remedy(const UnknownPackets& unknown);

} // namespace locus
