// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

/// Compression formats of chunks and messages of bags.
namespace locus::tools {

/// Limit on a block; longer ones are treated as damaged. Recorders make chunks of some hundred kB to some MB by
/// default. Reading a bag needs memory for a few blocks only.
inline constexpr std::uint32_t kMaxBlockBytes = 1U << 28U;

/// Returns false if `in` is truncated or does not decompress to exactly the size of `out`.
bool decompress_bzip2(std::span<const std::byte> in, std::span<std::byte> out);
bool decompress_lz4(std::span<const std::byte> in, std::span<std::byte> out); ///< LZ4's frame format
bool decompress_zstd(std::span<const std::byte> in, std::span<std::byte> out);

} // namespace locus::tools
