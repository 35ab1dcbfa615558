// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

namespace locus::tools {

/// Unpacks what was packed by LZF, the way of PCD's binary_compressed, and fills `out`. False where `packed` is no such
/// thing or is of another length. Any bytes will do. Any thread.
///
/// A byte below 32 is followed by as many bytes and one more, which are copied. Any other refers back: its upper three
/// bits are a length, 7 of them having the next byte added, two less than what is copied; its lower five and the next
/// byte are how far back that lies, less one.
bool unpack_lzf(std::span<const std::byte> packed, std::span<std::byte> out);

} // namespace locus::tools
