// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "bags/bag.hpp"
#include "bags/ros1_record.hpp"

namespace locus::tools {

/// A bag of ROS 1, format 2.0, with plain, LZ4 or bzip2 chunks.
///
/// Read from its beginning to its end, so that one that was never closed, or breaks off, is read as far as it goes: up
/// to its last whole chunk. The index at the end serves to know the topics beforehand; without it the bag is read
/// through for that.
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
  void take_chunk(const BagRecord& chunk);
  void take_connection(const BagRecord& connection);
  bool take_message(const BagRecord& message);
  void go_to(std::uint64_t place);
  void break_off(const std::string& why);

  std::filesystem::path file_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t first_record_ = 0; ///< behind the header of the bag
  std::uint64_t index_ = 0;        ///< where it begins; 0: the recorder has not come to write it
  std::uint64_t at_ = 0;           ///< how far the file has been read
  std::vector<std::byte> header_, data_;
  std::vector<std::byte> chunk_;    ///< uncompressed
  std::span<const std::byte> left_; ///< of it
  BagMessage message_{};
  std::string break_; ///< where and why reading stopped before the end; empty while all is well
};

} // namespace locus::tools
