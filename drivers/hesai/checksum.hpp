// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace locus::hesai {

/// Computes the CRC of packets with functional safety: polynomial 04C11DB7, most significant bit first, initial value
/// all ones, no final inversion (CRC-32/MPEG-2). The manuals do not name the variant; it matches all packets of a
/// recording.
std::uint32_t crc32(std::span<const std::byte> bytes);

} // namespace locus::hesai
