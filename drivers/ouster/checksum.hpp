// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace locus::ouster {

/// CRC-64 with the polynomial of ECMA-182, reflected, as the last 8 bytes of a packet hold it of all before them.
std::uint64_t crc64(std::span<const std::byte> bytes);

/// Whether the last 8 bytes are the checksum of the others. Firmware before 2.5 fills them with a constant, as do the
/// profiles for functional safety. Precondition: at least 8 bytes.
bool has_right_checksum(std::span<const std::byte> packet);
/// Makes it right. The same precondition.
void seal(std::span<std::byte> packet);

} // namespace locus::ouster
