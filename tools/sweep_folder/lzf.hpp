// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

namespace locus::tools {

/// Decompresses LZF, the compression of PCD's binary_compressed, and fills `out`. Returns false if `packed` is invalid
/// or of another length. Safe for any bytes. Any thread.
///
/// A byte below 32 is the length of a literal minus one, which follows. Any other is a back reference: its upper three
/// bits are the length minus two, where 7 means that the next byte is added; its lower five bits and the next byte are
/// the distance minus one.
bool unpack_lzf(std::span<const std::byte> packed, std::span<std::byte> out);

} // namespace locus::tools
