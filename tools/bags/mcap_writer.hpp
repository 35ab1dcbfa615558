// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "bags/mcap_record.hpp"
#include "core/base/stamp.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::tools {

/// Encodes numbers and strings as bytes of an MCAP file; the counterpart of MessageReader.
class McapBytes {
 public:
  template <class Number> McapBytes& number(Number value) {
    static_assert(std::is_arithmetic_v<Number> && std::endian::native == std::endian::little);
    return bytes(std::as_bytes(std::span{&value, 1}));
  }
  McapBytes& bytes(std::span<const std::byte> more);
  /// Appends the bytes, prefixed by their length in 32 bits.
  McapBytes& sequence(std::span<const std::byte> more);
  McapBytes& text(std::string_view text) { return sequence(std::as_bytes(std::span{text})); }
  McapBytes& record(McapOp op, const McapBytes& content);

  [[nodiscard]] std::span<const std::byte> all() const { return all_; }
  [[nodiscard]] std::size_t size() const { return all_.size(); }
  void clear() { all_.clear(); }

 private:
  std::vector<std::byte> all_;
};

/// Writes an MCAP file of ROS 2 as rosbag2 does: zstd chunks with their indices, a summary, checksums. Memory holds one
/// chunk and the indices, 16 bytes per message. One owner.
class McapWriter {
 public:
  /// Throws Failure, as do write() and close(): a full disk is reported at once rather than after hours of work.
  explicit McapWriter(const std::filesystem::path& file);

  struct Topic {
    std::string name;
    std::string type;       ///< "nav_msgs/msg/Odometry"
    std::string definition; ///< ros2_definition()
    std::string hash;       ///< ROS 2's type hash: "RIHS01_...", or empty
  };
  /// Adds a topic, at most 65535; returns the channel for write().
  std::uint16_t add(const Topic& topic);
  /// Writes a message in CDR.
  void write(std::uint16_t channel, Stamp stamp, std::span<const std::byte> message);
  /// Completes the file.
  void close();

 private:
  struct Chunk {
    std::uint64_t first_ns = 0, last_ns = 0;
    std::uint64_t begin = 0, length = 0, indices_length = 0, packed_size = 0, size = 0;
    std::map<std::uint16_t, std::uint64_t> index_of; ///< position of the index of a channel
  };

  void put(McapOp op, const McapBytes& content);
  void put(std::span<const std::byte> bytes);
  void finish_chunk();
  void put_indices(Chunk& chunk);
  McapBytes statistics() const;
  void put_summary();

  OutputFile file_;
  std::uint64_t at_ = 0;                            ///< bytes written so far
  McapBytes schemas_, channels_;                    ///< encoded records
  std::map<std::uint16_t, std::uint64_t> messages_; ///< message count by channel
  McapBytes records_;                               ///< of the chunk being filled
  Chunk chunk_;                                     ///< the chunk being filled
  std::map<std::uint16_t, McapBytes> times_;        ///< times of its messages with their offsets in it
  std::vector<Chunk> chunks_;                       ///< already written
  std::vector<std::byte> packed_;
};

} // namespace locus::tools
