// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"
#include "bags/mcap_record.hpp"

namespace locus::tools {

/// MCAP file of ROS 2 or ROS 1, with uncompressed, LZ4 or zstd chunks, or without chunks.
///
/// Reads sequentially, so that a file that was not closed or is truncated is read up to its last complete chunk.
/// The summary at the end lists the topics in advance; without it the file is scanned for them first. Drops chunks that
/// are damaged or larger than kMaxBlockBytes. The type of a topic in an encoding other than those of ROS states that
/// encoding. One chunk is in memory at a time, compressed and uncompressed.
class McapBag : public Bag {
 public:
  /// Opens the file; messages call it `name`. Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& file, std::string name);

  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  McapBag(const std::filesystem::path& file, std::string name);

  [[nodiscard]] std::optional<std::string> read_magic();
  bool read_topics_from_summary();
  bool accept_summary(std::span<const std::byte> summary);
  std::optional<McapFooter> read_footer();
  bool read_at(std::uint64_t place, std::span<std::byte> bytes);
  std::optional<McapRecord> next_record();
  std::optional<McapRecord> read_record();
  bool accept(const McapRecord& record);
  void accept_schema(const McapRecord& record);
  void accept_channel(const McapRecord& record);
  void open_chunk(const McapRecord& record);
  bool accept_message(const McapRecord& record);
  void free_memory();
  std::nullopt_t break_off();
  void leave_out(const std::string& why);

  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t at_ = 0;    ///< read position in the file
  std::uint64_t place_ = 0; ///< start of the latest record
  bool is_closed_ = false;  ///< has its footer
  bool is_over_ = false;    ///< no more records
  std::vector<std::byte> record_, chunk_;
  std::span<const std::byte> records_;  ///< of the current chunk
  std::vector<std::uint32_t> messages_; ///< offsets in it of its messages, in the order of reception
  std::size_t next_ = 0;                ///< index of the next one
  std::map<std::uint16_t, std::string> schemas_;
  BagMessage message_{};

  std::uint64_t timeless_ = 0, left_out_ = 0; ///< dropped messages; unreadable records
  std::string first_left_out_;                ///< of the records: position and reason
  std::string break_;                         ///< reason for stopping before the end; empty if there is none
};

} // namespace locus::tools
