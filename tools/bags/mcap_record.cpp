// SPDX-License-Identifier: Apache-2.0
#include "bags/mcap_record.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include "bags/bag.hpp"
#include "bags/decompression.hpp"

namespace locus::tools {

std::optional<McapRecord> pop_mcap_record(std::span<const std::byte>& bytes) {
  MessageReader reader(bytes, Serialisation::ros1);
  const auto op = static_cast<McapOp>(reader.number<std::uint8_t>());
  const std::span<const std::byte> content = reader.bytes(reader.number<std::uint64_t>());
  if (!reader.whole())
    return std::nullopt;
  bytes = bytes.subspan(kMcapRecordHead + content.size());
  return McapRecord{op, content};
}

std::optional<McapSchema> McapSchema::read(const McapRecord& record) {
  MessageReader fields = record.fields();
  McapSchema schema;
  schema.id = fields.number<std::uint16_t>();
  schema.name = fields.text();
  schema.encoding = fields.text();
  schema.definition = fields.text();
  return fields.whole() && schema.id != 0 ? std::optional(std::move(schema)) : std::nullopt;
}

std::optional<McapChannel> McapChannel::read(const McapRecord& record) {
  MessageReader fields = record.fields();
  McapChannel channel;
  channel.id = fields.number<std::uint16_t>();
  channel.schema = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.encoding = fields.text();
  return fields.whole() ? std::optional(std::move(channel)) : std::nullopt;
}

std::optional<McapFooter> McapFooter::read(const McapRecord& record) {
  MessageReader fields = record.fields();
  McapFooter footer;
  footer.summary_start = fields.number<std::uint64_t>();
  footer.summary_offset_start = fields.number<std::uint64_t>();
  footer.summary_crc = fields.number<std::uint32_t>();
  return fields.whole() && record.op == McapOp::footer ? std::optional(footer) : std::nullopt;
}

std::uint32_t mcap_crc(std::span<const std::byte> bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

McapChunkRecords unpack_mcap_chunk(const McapRecord& chunk, std::vector<std::byte>& room) {
  MessageReader fields = chunk.fields();
  fields.bytes(2 * sizeof(std::uint64_t)); // times of the first and last message
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const std::string_view compression = fields.text();
  const std::span<const std::byte> packed = fields.bytes(fields.number<std::uint64_t>());
  if (!fields.whole())
    return {{}, "its lengths do not fit"};
  if (size > kMaxBlockBytes)
    return {{}, fmt::format("it claims {} bytes, more than {}", size, kMaxBlockBytes)};
  std::span<const std::byte> records = packed;
  bool is_whole = packed.size() == size;
  if (compression == "lz4" || compression == "zstd") {
    room.resize(size);
    records = room;
    is_whole = compression == "lz4" ? decompress_lz4(packed, room) : decompress_zstd(packed, room);
  } else if (!compression.empty()) {
    return {{}, fmt::format("it is compressed by \"{}\"; none, lz4 and zstd are read", printable(compression))};
  }
  if (!is_whole)
    return {{}, "its contents do not have their size"};
  if (crc != 0 && mcap_crc(records) != crc)
    return {{}, "its checksum is wrong"};
  return {records, ""};
}

} // namespace locus::tools
