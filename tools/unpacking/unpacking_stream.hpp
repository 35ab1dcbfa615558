// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/base/expected.hpp"
#include "drivers/files/byte_stream.hpp"
#include "drivers/files/capture.hpp"

namespace locus::tools {

/// Decompresses gzip, xz or zstd, detected by the first bytes, while reading; passes anything else through.
/// Concatenated files are read one after the other. Uses at most 256 MB of memory and fails for files that need more.
std::unique_ptr<ByteStream> unpacked(std::unique_ptr<ByteStream> packed);

/// Opens a capture, decompressed while reading. Fails as Capture::open() does.
Expected<Capture, std::string> open_capture(const std::filesystem::path& file);

} // namespace locus::tools
