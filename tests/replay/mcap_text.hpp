// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bag_writer.hpp"

/// Writes MCAP record by record, so that tests can corrupt any of them.
namespace locus::test {

enum class McapCompression { none, lz4, zstd };

std::string mcap_magic();
std::string mcap_record(int op, const std::string& content);
std::string mcap_header(const std::string& profile = "ros2");
std::string mcap_schema(std::uint16_t id, const std::string& name, const std::string& encoding = "ros2msg");
std::string mcap_channel(std::uint16_t id, std::uint16_t schema, const std::string& topic,
                         const std::string& encoding = "cdr");
/// The publish time is 7 ns after the log time.
std::string mcap_message(std::uint16_t channel, std::uint64_t log_time_ns, const std::string& data);
/// Contains only the fields that readers use.
std::string mcap_statistics(std::uint64_t messages, std::uint32_t channels);

/// Header fields of a chunk, possibly inconsistent with its content.
struct McapChunkClaims {
  std::uint64_t size;
  std::uint32_t crc;
  std::string compression;
};
std::string mcap_chunk(const std::string& packed, const McapChunkClaims& claims);
/// Writes a valid chunk.
std::string mcap_chunk(const std::string& records, McapCompression compression = McapCompression::none);
std::string packed(const std::string& bytes, McapCompression compression);
std::uint32_t crc_of(const std::string& bytes);

/// Writes DataEnd, a summary with these records if there are any, Footer and magic; `before` is the file so far.
std::string mcap_end(const std::string& before, const std::string& summary = "");

/// Layout options of a file.
struct McapForm {
  McapCompression compression = McapCompression::none;
  bool chunked = true; ///< ten messages per chunk
  bool summary = true; ///< schemas, channels and statistics
  bool closed = true;
};

std::string mcap_file(std::span<const RecordedMessage> messages, RosVersion ros, const McapForm& form = {});

} // namespace locus::test
