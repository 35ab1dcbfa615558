// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/stamp.hpp"

namespace locus {

/// Captured frame of either file format.
struct CapturedFrame {
  int link_type = 0; ///< libpcap's DLT_...
  std::span<const std::byte> bytes;
  std::size_t wire_bytes = 0; ///< length before truncation to the snap length
  std::optional<Stamp> stamp; ///< empty if it is outside the range of Stamp
};

/// Reads the frames of a pcapng file: any number of sections of either byte order, and of interfaces of any link type,
/// snap length and time resolution, which libpcap reads only if all interfaces are alike. Blocks without frames are
/// skipped. A simple packet block holds no time: its stamp is Stamp{}. Single owner, not thread-safe. Allocates nothing
/// per frame once the longest block has been read.
class PcapngReader {
 public:
  /// Owns the file, which must be at its start.
  explicit PcapngReader(std::FILE* file) : file_(file) {}

  /// Reads up to the first interface description. Returns false if there is none; problem() then has the reason.
  bool open();

  /// Returns the next frame, valid until the next call; empty at the end of the file or on an error.
  std::optional<CapturedFrame> next();

  /// Returns why reading stopped before the end of the file; empty if it did not.
  [[nodiscard]] std::string_view problem() const { return problem_; }
  [[nodiscard]] std::FILE* file() const { return file_.get(); }

 private:
  /// Interface description; times are in units of 10^-exponent or 2^-exponent seconds.
  struct Interface {
    int link_type = 0;
    std::uint32_t snap_bytes = 0; ///< 0: no limit
    bool is_binary = false;
    int exponent = 6;
    std::int64_t offset_s = 0;

    [[nodiscard]] std::optional<Stamp> stamp(std::uint64_t ticks) const;
  };
  struct Closer {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  bool read_block();
  bool read_bytes(std::span<std::byte> out);
  bool stop(std::string_view problem);
  bool start_section();
  bool add_interface();
  [[nodiscard]] std::optional<CapturedFrame> frame();
  [[nodiscard]] std::optional<CapturedFrame> frame_in(const Interface& interface, std::size_t at,
                                                      std::uint32_t wire_bytes, std::uint32_t bytes,
                                                      std::optional<Stamp> stamp);
  [[nodiscard]] std::uint16_t u16(std::size_t at) const;
  [[nodiscard]] std::uint32_t u32(std::size_t at) const;
  [[nodiscard]] std::uint64_t u64(std::size_t at) const;

  std::unique_ptr<std::FILE, Closer> file_;
  std::uint32_t type_ = 0;      ///< of the current block
  std::vector<std::byte> body_; ///< of the current block, without its lengths
  bool is_big_endian_ = false;  ///< byte order of the current section
  std::vector<Interface> interfaces_;
  std::string_view problem_;
};

} // namespace locus
