// SPDX-License-Identifier: Apache-2.0
#include "mcap_text.hpp"

#include <map>
#include <stdexcept>
#include <utility>

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

namespace locus::test {
namespace {

enum Op {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kStatistics = 11,
  kDataEnd = 15
};

template <class Number> std::string raw_number(Number value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

std::string counted(const std::string& content) {
  return raw_number(static_cast<std::uint32_t>(content.size())) + content;
}

} // namespace

std::string mcap_magic() { return {"\x89MCAP0\r\n", 8}; }

std::string mcap_record(int op, const std::string& content) {
  return static_cast<char>(op) + raw_number(static_cast<std::uint64_t>(content.size())) + content;
}

std::string mcap_header(const std::string& profile) {
  return mcap_record(kHeader, counted(profile) + counted("locusd's tests"));
}

std::string mcap_schema(std::uint16_t id, const std::string& name, const std::string& encoding) {
  return mcap_record(kSchema, raw_number(id) + counted(name) + counted(encoding) + counted("float64 x"));
}

std::string mcap_channel(std::uint16_t id, std::uint16_t schema_id, const std::string& topic,
                         const std::string& encoding) {
  return mcap_record(kChannel, raw_number(id) + raw_number(schema_id) + counted(topic) + counted(encoding) +
                                   counted(counted("offered_qos_profiles") + counted("")));
}

std::string mcap_message(std::uint16_t channel_id, std::uint64_t log_time_ns, const std::string& data) {
  const std::uint64_t publish_time_ns = log_time_ns + 7; // differs, to detect readers that confuse them
  return mcap_record(kMessage, raw_number(channel_id) + raw_number(std::uint32_t{0}) + raw_number(log_time_ns) +
                                   raw_number(publish_time_ns) + data);
}

std::string mcap_statistics(std::uint64_t messages, std::uint32_t channels) {
  return mcap_record(kStatistics, raw_number(messages) + raw_number(static_cast<std::uint16_t>(channels)) +
                                      raw_number(channels) + std::string(2 * 4 + 4 + 2 * 8, '\0') + counted(""));
}

std::string mcap_chunk(const std::string& bytes, const McapChunkClaims& claims) {
  return mcap_record(kChunk, raw_number(std::uint64_t{0}) + raw_number(std::uint64_t{0}) + raw_number(claims.size) +
                                 raw_number(claims.crc) + counted(claims.compression) +
                                 raw_number(static_cast<std::uint64_t>(bytes.size())) + bytes);
}

std::string mcap_chunk(const std::string& records, McapCompression compression) {
  const std::string name = compression == McapCompression::none  ? ""
                           : compression == McapCompression::lz4 ? "lz4"
                                                                 : "zstd";
  return mcap_chunk(packed(records, compression), {records.size(), crc_of(records), name});
}

std::string packed(const std::string& bytes, McapCompression compression) {
  if (compression == McapCompression::none)
    return bytes;
  const bool is_lz4 = compression == McapCompression::lz4;
  std::string out(is_lz4 ? LZ4F_compressFrameBound(bytes.size(), nullptr) : ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = is_lz4 ? LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), nullptr)
                                  : ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 1);
  if (size > out.size())
    throw std::runtime_error("cannot be compressed");
  out.resize(size);
  return out;
}

std::uint32_t crc_of(const std::string& bytes) {
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

std::string mcap_end(const std::string& before, const std::string& summary) {
  const std::string data = mcap_record(kDataEnd, raw_number(std::uint32_t{0}));
  const std::uint64_t start = summary.empty() ? 0 : before.size() + data.size();
  const std::string fields = raw_number(start) + raw_number(std::uint64_t{0});
  const std::string head = static_cast<char>(kFooter) + raw_number(std::uint64_t{20});
  return data + summary + head + fields + raw_number(crc_of(summary + head + fields)) + mcap_magic();
}

std::string mcap_file(std::span<const RecordedMessage> messages, RosVersion ros, const McapForm& form) {
  constexpr std::size_t kMessagesInChunk = 10;
  const bool is_ros1 = ros == RosVersion::ros1;
  std::map<std::string, std::uint16_t> channels;
  std::string file = mcap_magic() + mcap_header(is_ros1 ? "ros1" : "ros2"), records, declarations;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const RecordedMessage& m = messages[i];
    const auto [id, is_new] = channels.try_emplace(m.topic, static_cast<std::uint16_t>(channels.size() + 1));
    if (is_new) {
      std::string type = m.type;
      const std::string declaration = mcap_schema(id->second, is_ros1 ? type : type.insert(type.find('/'), "/msg"),
                                                  is_ros1 ? "ros1msg" : "ros2msg") +
                                      mcap_channel(id->second, id->second, m.topic, is_ros1 ? "ros1" : "cdr");
      declarations += declaration;
      records += declaration;
    }
    records += mcap_message(id->second, static_cast<std::uint64_t>(to_ns(m.recorded)),
                            {reinterpret_cast<const char*>(m.data.data()), m.data.size()});
    if (form.chunked && ((i + 1) % kMessagesInChunk == 0 || i + 1 == messages.size()))
      file += mcap_chunk(std::exchange(records, {}), form.compression);
  }
  file += records;
  const std::string figures = mcap_statistics(messages.size(), static_cast<std::uint32_t>(channels.size()));
  if (form.closed)
    file += mcap_end(file, form.summary ? declarations + figures : "");
  return file;
}

} // namespace locus::test
