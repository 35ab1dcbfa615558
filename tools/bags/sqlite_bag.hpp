// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bags/bag.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace locus::tools {

/// One database of rosbag2, in the order of reception. Never writes to it.
class SqliteBag : public Bag {
 public:
  /// Opens the file; messages call it `name`. Fails with one line for the user.
  static Expected<std::unique_ptr<Bag>, std::string> open(const std::filesystem::path& file, std::string name);

  const BagMessage* next() override;
  void rewind() override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  struct Closer {
    void operator()(sqlite3* database) const;
    void operator()(sqlite3_stmt* statement) const;
  };
  using Statement = std::unique_ptr<sqlite3_stmt, Closer>;

  explicit SqliteBag(std::string name) : name_(std::move(name)) {}
  Statement prepare(const char* sql);
  std::optional<std::string> read_topics();
  bool is_in_order_of_rows();
  bool read_row();

  std::string name_;
  std::unique_ptr<sqlite3, Closer> database_;
  double row_count_ = 0; ///< largest message number
  std::optional<bool> is_in_order_of_rows_;
  Statement rows_;        ///< declared after the database, to be destroyed first
  std::uint64_t row_ = 0; ///< rows read so far
  bool is_over_ = false;
  BagMessage message_{};
  std::uint64_t timeless_ = 0; ///< dropped messages
  std::string break_;          ///< position and reason of a stop before the end; empty if there is none
};

} // namespace locus::tools
