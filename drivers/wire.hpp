// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace locus {

/// Little-endian integers of lidar packets, at any alignment and on any host byte order.
inline std::uint16_t read_u16(const std::byte* at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(at[0]) | std::to_integer<unsigned>(at[1]) << 8);
}

inline std::uint32_t read_u32(const std::byte* at) {
  return std::uint32_t{read_u16(at)} | std::uint32_t{read_u16(at + 2)} << 16;
}

inline std::uint64_t read_u64(const std::byte* at) {
  return std::uint64_t{read_u32(at)} | std::uint64_t{read_u32(at + 4)} << 32;
}

/// Writes the lowest `bytes` bytes of `value`.
inline void put_little_endian(std::byte* at, std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i)
    at[i] = static_cast<std::byte>(value >> (8 * i));
}

} // namespace locus
