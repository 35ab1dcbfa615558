// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/clouds/message_reader.hpp"

/// Records of an MCAP file, after the specification (mcap.dev/spec), version 0. Numbers and strings are encoded as in
/// ROS 1 messages.
namespace locus::tools {

inline constexpr std::string_view kMcapMagic{"\x89MCAP0\r\n", 8}; ///< at the beginning and at the end

enum class McapOp : std::uint8_t {
  none = 0,
  header = 1,
  footer = 2,
  schema = 3,
  channel = 4,
  message = 5,
  chunk = 6,
  message_index = 7,
  chunk_index = 8,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

inline constexpr std::size_t kMcapRecordHead = 9; ///< bytes: opcode and length of the content
inline constexpr std::size_t kMcapFooterBytes = kMcapRecordHead + 20;

struct McapRecord {
  McapOp op;
  std::span<const std::byte> content;

  [[nodiscard]] MessageReader fields() const { return {content, Serialisation::ros1}; }
};

/// Removes the first record from the bytes and returns it; nothing if they do not start with a complete one.
std::optional<McapRecord> pop_mcap_record(std::span<const std::byte>& bytes);

struct McapSchema {
  std::uint16_t id = 0;
  std::string name, encoding, definition;

  static std::optional<McapSchema> read(const McapRecord& record);
};

struct McapChannel {
  std::uint16_t id = 0, schema = 0; ///< 0: none
  std::string topic, encoding;

  static std::optional<McapChannel> read(const McapRecord& record);
};

struct McapFooter {
  std::uint64_t summary_start = 0; ///< 0: none
  std::uint64_t summary_offset_start = 0;
  std::uint32_t summary_crc = 0; ///< 0: unknown, as below

  static std::optional<McapFooter> read(const McapRecord& record);
};

/// Computes zlib's CRC-32; `before` is that of the preceding bytes.
std::uint32_t mcap_crc(std::span<const std::byte> bytes, std::uint32_t before = 0);

/// Records in a chunk, which point into `chunk` itself or into `room`, or the reason why they cannot be read.
struct McapChunkRecords {
  std::span<const std::byte> bytes;
  std::string problem; ///< empty if there is none
};
McapChunkRecords unpack_mcap_chunk(const McapRecord& chunk, std::vector<std::byte>& room);

} // namespace locus::tools
