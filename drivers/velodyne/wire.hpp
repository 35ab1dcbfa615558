// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace locus {

/// Little-endian integers, as Velodyne's packets hold them, at any address of any machine.
inline std::uint16_t read_u16(const std::byte* at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(at[0]) | std::to_integer<unsigned>(at[1]) << 8);
}

inline std::uint32_t read_u32(const std::byte* at) {
  return std::uint32_t{read_u16(at)} | std::uint32_t{read_u16(at + 2)} << 16;
}

} // namespace locus
