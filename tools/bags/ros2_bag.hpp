// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"

namespace locus::tools {

/// Returns whether rosbag2 wrote this folder: with metadata.yaml, or with bag files only.
bool is_ros2_bag_folder(const std::filesystem::path& folder);
/// Detects, by name or first bytes, an SQLite database or MCAP, each also compressed with zstd.
bool is_ros2_bag_file(const std::filesystem::path& file);

/// ROS 2 bag of one or several consecutive files, SQLite or MCAP, uncompressed or compressed with zstd per file or per
/// message; the first bytes determine the format. Never writes to the bag.
///
/// Decompresses a file that is compressed as a whole into a temporary one first, see UnpackedCopy. Also reads MCAP of
/// ROS 1.
class Ros2Bag : public Bag {
 public:
  /// Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& where);

  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  struct File {
    std::unique_ptr<Bag> bag;
    std::vector<std::optional<std::size_t>> topic_of; ///< our index by the file's; nothing for a dropped topic
  };

  std::optional<std::string> add(const std::filesystem::path& file);
  std::optional<std::string> add(const std::filesystem::path& file, const std::filesystem::path& readable);
  void learn_topics(File& file);
  const BagMessage* next_packed();
  bool unpack();

  std::vector<File> files_;
  std::vector<std::string> breaks_; ///< a line for each compressed file that is incomplete
  std::string name_;                ///< of the file or folder opened
  std::size_t current_ = 0;         ///< file index
  BagMessage message_{};
  std::vector<std::byte> unpacked_; ///< data of message_
  std::uint64_t damaged_ = 0;       ///< messages that could not be decompressed
};

} // namespace locus::tools
