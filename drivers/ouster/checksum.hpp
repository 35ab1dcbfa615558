// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace locus::ouster {

/// Computes CRC-64 with the ECMA-182 polynomial, reflected, which the last 8 bytes of a packet hold for the bytes
/// before.
std::uint64_t crc64(std::span<const std::byte> bytes);

/// Returns true if the last 8 bytes are the checksum of the others. Firmware before 2.5 fills them with a constant, as
/// do the functional-safety profiles. Precondition: at least 8 bytes.
bool has_right_checksum(std::span<const std::byte> packet);
/// Updates the checksum. Same precondition.
void seal(std::span<std::byte> packet);

} // namespace locus::ouster
