// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bag_writer.hpp"

/// MCAP written by hand, record by record, so that a test may write any of them wrongly.
namespace locus::test {

enum class McapCompression { none, lz4, zstd };

std::string mcap_magic();
std::string mcap_record(int op, const std::string& content);
std::string mcap_header(const std::string& profile = "ros2");
std::string mcap_schema(std::uint16_t id, const std::string& name, const std::string& encoding = "ros2msg");
std::string mcap_channel(std::uint16_t id, std::uint16_t schema, const std::string& topic,
                         const std::string& encoding = "cdr");
/// Published later than it was logged, by 7 ns.
std::string mcap_message(std::uint16_t channel, std::uint64_t log_time_ns, const std::string& data);
/// As far as readers look at them.
std::string mcap_statistics(std::uint64_t messages, std::uint32_t channels);

/// What a chunk says of the records in it; nothing of the rest is made to fit.
struct McapChunkClaims {
  std::uint64_t size;
  std::uint32_t crc;
  std::string compression;
};
std::string mcap_chunk(const std::string& packed, const McapChunkClaims& claims);
/// One that is right.
std::string mcap_chunk(const std::string& records, McapCompression compression = McapCompression::none);
std::string packed(const std::string& bytes, McapCompression compression);
std::uint32_t crc_of(const std::string& bytes);

/// DataEnd, a summary of these records if there are any, Footer and magic; `at`: what stands before.
std::string mcap_end(const std::string& before, const std::string& summary = "");

/// How a file is written.
struct McapForm {
  McapCompression compression = McapCompression::none;
  bool chunked = true; ///< ten messages to a chunk
  bool summary = true; ///< with schemas, channels and statistics
  bool closed = true;
};

std::string mcap_file(std::span<const RecordedMessage> messages, RosVersion ros, const McapForm& form = {});

} // namespace locus::test
