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

/// A folder that rosbag2 wrote: with metadata.yaml, or with its files alone.
bool is_ros2_bag_folder(const std::filesystem::path& folder);
/// By name or first bytes: an SQLite database or MCAP, either also packed with zstd.
bool is_ros2_bag_file(const std::filesystem::path& file);

/// A bag of ROS 2, of one file or of several that follow each other, SQLite or MCAP, packed with zstd as a whole or
/// each message by itself or not at all: what it is is told from its first bytes. Reads and never writes.
///
/// A file that is packed as a whole is unpacked into a temporary one first, see UnpackedCopy. MCAP of ROS 1 is read,
/// too.
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
    std::vector<std::optional<std::size_t>> topic_of; ///< ours, by its own index; nothing for one that is left out
  };

  std::optional<std::string> add(const std::filesystem::path& file);
  std::optional<std::string> add(const std::filesystem::path& file, const std::filesystem::path& readable);
  void learn_topics(File& file);
  const BagMessage* next_packed();
  bool unpack();

  std::vector<File> files_;
  std::vector<std::string> breaks_; ///< a line for each packed file that is not whole
  std::string name_;                ///< of what was opened
  std::size_t current_ = 0;         ///< of the files
  BagMessage message_{};
  std::vector<std::byte> unpacked_; ///< the data of message_
  std::uint64_t damaged_ = 0;       ///< messages that could not be unpacked
};

} // namespace locus::tools
