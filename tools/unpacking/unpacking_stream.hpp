// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/base/expected.hpp"
#include "drivers/files/byte_stream.hpp"
#include "drivers/files/capture.hpp"

namespace locus::tools {

/// What gzip, xz or zstd packed, as its first bytes tell, unpacked while it is read; anything else as it is. Several
/// packed files in one are read one after the other. At most 256 MB of memory: what asks for more is refused.
std::unique_ptr<ByteStream> unpacked(std::unique_ptr<ByteStream> packed);

/// A capture, unpacked while it is read. As Capture::open().
Expected<Capture, std::string> open_capture(const std::filesystem::path& file);

} // namespace locus::tools
