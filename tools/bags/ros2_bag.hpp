// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace locus::tools {

/// A folder that rosbag2 wrote: with metadata.yaml, or with its files alone.
bool is_ros2_bag_folder(const std::filesystem::path& folder);
/// By name or first bytes: an SQLite database, or what is refused by name: MCAP, or compressed.
bool is_ros2_bag_file(const std::filesystem::path& file);

/// A bag of ROS 2 in SQLite, of one file or of several that follow each other, each in the order of reception. Reads
/// and never writes.
class Ros2Bag : public Bag {
 public:
  /// Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& where);

  [[nodiscard]] Serialisation serialisation() const override { return Serialisation::cdr; }
  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  struct Closer {
    void operator()(sqlite3* database) const;
    void operator()(sqlite3_stmt* statement) const;
  };
  using Database = std::unique_ptr<sqlite3, Closer>;
  using Statement = std::unique_ptr<sqlite3_stmt, Closer>;
  struct File {
    std::filesystem::path path;
    Database database;
    std::map<std::int64_t, std::size_t> topic_of; ///< by its number in this file
    double rows = 0;                              ///< greatest number of a message
  };

  static Statement prepare(const File& file, const char* sql);
  std::optional<std::string> add(const std::filesystem::path& file);
  std::optional<std::string> read_topics(File& file);
  bool read_row();
  void break_off(const File& file);

  std::vector<File> files_;
  std::size_t current_ = 0; ///< of the files
  Statement rows_;          ///< of the current file; declared after the databases, to go before them
  std::uint64_t row_ = 0;   ///< as many of it are read
  BagMessage message_{};
  std::uint64_t timeless_ = 0; ///< messages left out
  std::string break_;          ///< where and why reading stopped before the end; empty while all is well
};

} // namespace locus::tools
