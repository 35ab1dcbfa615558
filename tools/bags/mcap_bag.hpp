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

/// An MCAP file of ROS 2 or ROS 1, with plain, LZ4 or zstd chunks or without any.
///
/// Read from its beginning to its end, so that one that was never closed, or breaks off, is read as far as it goes: up
/// to its last whole chunk. The summary at the end serves to know the topics beforehand; without it the file is read
/// through for that. A chunk that is damaged, or larger than kMaxBlockBytes, is left out. A topic in another encoding
/// than those of ROS has a type that says so. One chunk is in memory at a time, packed and unpacked.
class McapBag : public Bag {
 public:
  /// `name`: what messages call the file. Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& file, std::string name);

  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  McapBag(const std::filesystem::path& file, std::string name);

  [[nodiscard]] std::optional<std::string> read_magic();
  bool read_topics_from_summary();
  bool take_summary(std::span<const std::byte> summary);
  std::optional<McapFooter> read_footer();
  bool read_at(std::uint64_t place, std::span<std::byte> bytes);
  std::optional<McapRecord> next_record();
  std::optional<McapRecord> read_record();
  bool take(const McapRecord& record);
  void take_schema(const McapRecord& record);
  void take_channel(const McapRecord& record);
  void take_chunk(const McapRecord& record);
  bool take_message(const McapRecord& record);
  void free_memory();
  std::nullopt_t break_off();
  void leave_out(const std::string& why);

  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t at_ = 0;    ///< how far the file has been read
  std::uint64_t place_ = 0; ///< where the latest record begins
  bool is_closed_ = false;  ///< it has its end
  bool is_over_ = false;    ///< no more records
  std::vector<std::byte> record_, chunk_;
  std::span<const std::byte> left_; ///< of the chunk at hand
  std::map<std::uint16_t, std::string> schemas_;
  BagMessage message_{};

  std::uint64_t timeless_ = 0, left_out_ = 0; ///< messages; records that cannot be read
  std::string first_left_out_;                ///< of the records: where, and why
  std::string break_;                         ///< where reading stopped before the end; empty while all is well
};

} // namespace locus::tools
