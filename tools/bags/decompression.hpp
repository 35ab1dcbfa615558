// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

/// The ways in which chunks and messages of bags are compressed.
namespace locus::tools {

/// What is longer is damaged: recorders make chunks of some hundred kB to some MB unless they are told otherwise. No
/// bag takes more memory than a few of these.
inline constexpr std::uint32_t kMaxBlockBytes = 1U << 28U;

/// False where `in` is not whole or does not give exactly as many bytes as `out` has.
bool decompress_bzip2(std::span<const std::byte> in, std::span<std::byte> out);
bool decompress_lz4(std::span<const std::byte> in, std::span<std::byte> out); ///< LZ4's frame format
bool decompress_zstd(std::span<const std::byte> in, std::span<std::byte> out);

} // namespace locus::tools
