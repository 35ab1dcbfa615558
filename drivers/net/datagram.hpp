// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/stamp.hpp"

namespace locus {

struct LidarPacket;

/// One UDP datagram as it came from a socket or a capture. Addresses and ports are in host byte order. Owns nothing:
/// the payload lives until its source is asked for the next one.
struct Datagram {
  std::span<const std::byte> payload;
  std::uint32_t source_ip = 0;
  std::uint16_t source_port = 0;
  std::uint16_t destination_port = 0;
  Stamp receive_stamp;    ///< by the kernel or the capturing computer
  bool truncated = false; ///< longer on the wire than what was kept
  /// What decoding it gives, where a recording holds no bytes but returns: the payload is then empty. Lives as long.
  const LidarPacket* decoded = nullptr;
};

} // namespace locus
