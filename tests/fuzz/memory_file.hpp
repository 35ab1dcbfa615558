// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include <sys/mman.h>
#include <unistd.h>

#include "fuzz/fuzz_bytes.hpp"

namespace locus::fuzz {

/// A file that lies in memory and whose content changes from input to input. To be made once.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) { demand(descriptor_ >= 0); }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  /// The path of the file with this content.
  [[nodiscard]] std::filesystem::path with(const std::uint8_t* data, std::size_t size) const {
    demand(ftruncate(descriptor_, static_cast<off_t>(size)) == 0);
    demand(pwrite(descriptor_, data, size, 0) == static_cast<ssize_t>(size));
    return "/proc/self/fd/" + std::to_string(descriptor_);
  }

 private:
  int descriptor_;
};

} // namespace locus::fuzz
