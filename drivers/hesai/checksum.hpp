// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace locus::hesai {

/// The CRC that packets with functional safety carry: polynomial 04C11DB7, from the highest bit on, begun with ones and
/// not inverted at the end (CRC-32/MPEG-2). The manuals name none; it is the one that all packets of a recording have.
std::uint32_t crc32(std::span<const std::byte> bytes);

} // namespace locus::hesai
