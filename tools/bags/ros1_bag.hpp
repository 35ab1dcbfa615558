// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "bags/bag.hpp"
#include "bags/ros1_record.hpp"

namespace locus::tools {

/// ROS 1 bag, format 2.0, with uncompressed, LZ4 or bzip2 chunks.
///
/// Reads sequentially, so that a bag that was not closed or is truncated is read up to its last complete chunk.
/// The index at the end lists the topics in advance; without it the bag is scanned for them first.
class Ros1Bag : public Bag {
 public:
  /// Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& file);

  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  explicit Ros1Bag(std::filesystem::path file);

  std::optional<std::string> read_start();
  bool read_topics_from_index();
  std::optional<std::uint32_t> read_length();
  bool read_block(std::vector<std::byte>& block);
  bool skip_block();
  std::optional<BagRecord> next_record();
  std::optional<BagRecord> read_record();
  void open_chunk(const BagRecord& chunk);
  void add_connection(const BagRecord& connection);
  bool accept_message(const BagRecord& message);
  void go_to(std::uint64_t place);
  void break_off(const std::string& why);

  std::filesystem::path file_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t first_record_ = 0; ///< after the header of the bag
  std::uint64_t index_ = 0;        ///< start of the index; 0: the recorder did not get to write it
  std::uint64_t at_ = 0;           ///< read position in the file
  std::vector<std::byte> header_, data_;
  std::vector<std::byte> chunk_;    ///< uncompressed
  std::span<const std::byte> left_; ///< unread part of the chunk
  BagMessage message_{};
  std::string break_; ///< position and reason of a stop before the end; empty if there is none
};

} // namespace locus::tools
