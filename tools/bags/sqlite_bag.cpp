// SPDX-License-Identifier: Apache-2.0
#include "bags/sqlite_bag.hpp"

#include <algorithm>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <sqlite3.h>

#include "bags/decompression.hpp"
#include "bags/reception_order.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;

/// Returns a URI with which SQLite creates no files next to a bag that nobody writes to, as it would for a write-ahead
/// log.
std::string uri_of(const path& file) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(file).string()) {
    const bool has_meaning = c == '%' || c == '?' || c == '#';
    uri += has_meaning ? fmt::format("%{:02X}", c) : std::string(1, c);
  }
  const auto has = [&](const char* ending) {
    std::error_code ignored;
    return std::filesystem::exists(file.string() + ending, ignored);
  };
  return uri + (has("-wal") || has("-journal") ? "" : "?immutable=1");
}

std::string text_of(sqlite3_stmt* row, int column) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(row, column));
  return text != nullptr ? text : "";
}

std::span<const std::byte> bytes_of(sqlite3_stmt* row, int column) {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(row, column));
  return {data, data != nullptr ? static_cast<std::size_t>(sqlite3_column_bytes(row, column)) : 0};
}

} // namespace

void SqliteBag::Closer::operator()(sqlite3* database) const { sqlite3_close(database); }
void SqliteBag::Closer::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }

Expected<std::unique_ptr<Bag>, std::string> SqliteBag::open(const path& file, std::string name) {
  std::unique_ptr<SqliteBag> bag(new SqliteBag(std::move(name)));
  sqlite3* opened = nullptr; // errors show in the first query
  sqlite3_open_v2(uri_of(file).c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
  bag->database_.reset(opened);
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, kMaxBlockBytes);                     // no message is that long
  sqlite3_exec(opened, "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr); // to read truncated files
  if (const std::optional<std::string> problem = bag->read_topics())
    return fmt::format("{}: {}", bag->name_, *problem);
  return std::unique_ptr<Bag>(std::move(bag));
}

SqliteBag::Statement SqliteBag::prepare(const char* sql) {
  sqlite3_stmt* prepared = nullptr;
  sqlite3_prepare_v2(database_.get(), sql, -1, &prepared, nullptr); // nullptr yields SQLITE_MISUSE in each step
  return Statement(prepared);
}

/// Reads the topics. Returns the problem, or nothing.
std::optional<std::string> SqliteBag::read_topics() {
  const auto why = [&] {
    return fmt::format("not a ROS 2 bag, or damaged ({}); copy or record it again", sqlite3_errmsg(database_.get()));
  };
  const Statement tables =
      prepare("SELECT count(*) FROM pragma_table_list WHERE schema = 'main' AND type = 'table' AND "
              "name IN ('topics', 'messages')"); // a view may never end
  if (sqlite3_step(tables.get()) != SQLITE_ROW)
    return why();
  if (sqlite3_column_int(tables.get(), 0) != 2)
    return "not a ROS 2 bag, or damaged (it has no tables of topics and of messages); copy or record it again";
  const Statement topics = prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
  while (sqlite3_step(topics.get()) == SQLITE_ROW) {
    if (const std::string format = text_of(topics.get(), 3); format != "cdr" && !format.empty()) // early rosbag2: empty
      return fmt::format("its messages are serialised as \"{}\", not cdr; convert it with: ros2 bag convert",
                         printable(format));
    declare(sqlite3_column_int64(topics.get(), 0),
            {text_of(topics.get(), 1), ros1_type(text_of(topics.get(), 2)), Serialisation::cdr});
  }
  if (sqlite3_errcode(database_.get()) != SQLITE_DONE)
    return why();
  const Statement last = prepare("SELECT max(id) FROM messages");
  if (sqlite3_step(last.get()) == SQLITE_ROW)
    row_count_ = sqlite3_column_double(last.get(), 0);
  const Statement first = prepare("SELECT data FROM messages ORDER BY id LIMIT 1");
  if (const int status = sqlite3_step(first.get()); status != SQLITE_ROW && status != SQLITE_DONE)
    return why();
  return std::nullopt;
}

void SqliteBag::rewind() {
  rows_.reset();
  row_ = 0;
  is_over_ = false;
  timeless_ = 0;
  break_.clear();
}

const BagMessage* SqliteBag::next() {
  while (read_row()) {
    const std::optional<std::size_t> topic = topic_of(sqlite3_column_int64(rows_.get(), 0));
    const std::int64_t ns = sqlite3_column_int64(rows_.get(), 1);
    const bool has_time = ns >= 0 && ns <= kMaxBagTime_ns;
    timeless_ += has_time ? 0U : 1U;
    if (!topic || !has_time)
      continue;
    message_ = {*topic, stamp_from_ns(ns), bytes_of(rows_.get(), 2)};
    return &message_;
  }
  return nullptr;
}

/// Returns whether the rows are in the order of reception although their times are not, which players follow. The first
/// call reads the times of all rows.
bool SqliteBag::is_in_order_of_rows() {
  if (!is_in_order_of_rows_) {
    ReceptionOrder order;
    const Statement times = prepare("SELECT topic_id, timestamp FROM messages ORDER BY id");
    while (sqlite3_step(times.get()) == SQLITE_ROW) {
      const std::int64_t ns = sqlite3_column_int64(times.get(), 1);
      if (ns >= 0 && ns <= kMaxBagTime_ns)
        order.add(sqlite3_column_int64(times.get(), 0), ns);
    }
    is_in_order_of_rows_ = order.is_that_of_the_file();
  }
  return *is_in_order_of_rows_;
}

/// Steps to the next row; false after the last.
bool SqliteBag::read_row() {
  if (is_over_)
    return false;
  if (!rows_ && !is_in_order_of_rows()) // without rosbag2's index SQLite would sort all rows including their data
    rows_ = prepare("SELECT topic_id, timestamp, data FROM messages INDEXED BY timestamp_idx ORDER BY timestamp, id");
  if (!rows_)
    rows_ = prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY id");
  const int status = sqlite3_step(rows_.get());
  if (status == SQLITE_ROW) {
    ++row_;
    return true;
  }
  if (status != SQLITE_DONE)
    break_ = fmt::format("{}: message {}: the database is truncated or damaged ({}); what precedes it is used", name_,
                         row_ + 1, sqlite3_errmsg(database_.get()));
  rows_.reset();
  is_over_ = true;
  return false;
}

std::vector<std::string> SqliteBag::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty())
    lines.push_back(break_);
  if (timeless_ > 0)
    lines.push_back(timeless_messages(name_, timeless_));
  add_bound_warnings(name_, lines);
  return lines;
}

double SqliteBag::progress() const {
  if (is_over_)
    return 1;
  return row_count_ > 0 ? std::min(1.0, static_cast<double>(row_) / row_count_) : 0;
}

} // namespace locus::tools
