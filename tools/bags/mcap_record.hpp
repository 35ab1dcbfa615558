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

/// What an MCAP file is made of, after the specification (mcap.dev/spec), version 0. Its numbers and texts are written
/// as ROS 1 writes those of messages.
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

inline constexpr std::size_t kMcapRecordHead = 9; ///< bytes: the op, and the length of what follows
inline constexpr std::size_t kMcapFooterBytes = kMcapRecordHead + 20;

struct McapRecord {
  McapOp op;
  std::span<const std::byte> content;

  [[nodiscard]] MessageReader fields() const { return {content, Serialisation::ros1}; }
};

/// Takes the first record off the bytes; nothing where they do not begin with a whole one.
std::optional<McapRecord> take_mcap_record(std::span<const std::byte>& bytes);

struct McapSchema {
  std::uint16_t id = 0;
  std::string name, encoding, definition;

  static std::optional<McapSchema> read(const McapRecord& record);
};

struct McapChannel {
  std::uint16_t id = 0, schema = 0; ///< 0: it has none
  std::string topic, encoding;

  static std::optional<McapChannel> read(const McapRecord& record);
};

struct McapFooter {
  std::uint64_t summary_start = 0; ///< 0: there is none
  std::uint64_t summary_offset_start = 0;
  std::uint32_t summary_crc = 0; ///< 0: not known, as below

  static std::optional<McapFooter> read(const McapRecord& record);
};

/// CRC-32 as zlib's; `before` is that of the bytes before.
std::uint32_t mcap_crc(std::span<const std::byte> bytes, std::uint32_t before = 0);

/// The records in a chunk, which are those of `chunk` itself or in `room`; an error says what is wrong with them.
struct McapChunkRecords {
  std::span<const std::byte> bytes;
  std::string problem; ///< empty while all is well
};
McapChunkRecords unpack_mcap_chunk(const McapRecord& chunk, std::vector<std::byte>& room);

} // namespace locus::tools
