// SPDX-License-Identifier: Apache-2.0
#include "bags/ros2_bag.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <sqlite3.h>
#include <yaml-cpp/yaml.h>

namespace locus::tools {
namespace {

using std::filesystem::path;

constexpr const char* kMetadata = "metadata.yaml";
constexpr std::string_view kMcap = "\x89MCAP", kSqlite = "SQLite format 3", kZstd = "\x28\xB5\x2F\xFD";
constexpr std::string_view kConvert = "convert it to storage sqlite3 without compression with: ros2 bag convert";

bool starts_with(const path& file, std::string_view magic) {
  std::string start(magic.size(), '\0');
  std::ifstream{file, std::ios::binary}.read(start.data(), static_cast<std::streamsize>(start.size()));
  return start == magic;
}

/// Those that can be read and those that are refused by name.
std::vector<path> bag_files_in(const path& folder) {
  std::vector<path> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.ends_with(".db3") || name.ends_with(".mcap") || name.ends_with(".db3.zstd"))
      files.push_back(entry->path());
  }
  std::ranges::sort(files);
  return files;
}

/// The files of a folder in the order in which they were recorded, as its metadata have it, or by name.
Expected<std::vector<path>, std::string> files_of(const path& folder) {
  const path metadata = folder / kMetadata;
  std::error_code ignored;
  if (!std::filesystem::exists(metadata, ignored))
    return bag_files_in(folder);
  try {
    const YAML::Node bag = YAML::LoadFile(metadata.string())["rosbag2_bagfile_information"];
    const auto storage = bag["storage_identifier"].as<std::string>("");
    const auto compression = bag["compression_format"].as<std::string>("");
    if (!storage.empty() && storage != "sqlite3") // where it is not named, the files themselves tell
      return fmt::format("{}: storage {} is not read; {}", folder.string(), storage, kConvert);
    if (!compression.empty())
      return fmt::format("{}: compressed with {}, which is not read; {}", folder.string(), compression, kConvert);
    std::vector<path> files;
    for (const auto& file : bag["relative_file_paths"].as<std::vector<std::string>>())
      files.push_back(folder / path(file).filename()); // some versions put the name of the folder before it
    return files;
  } catch (const YAML::Exception& error) {
    return fmt::format("{}:{}: not what rosbag2 writes ({}); make it again with: ros2 bag reindex", metadata.string(),
                       error.mark.line + 1, error.msg);
  }
}

/// Nothing is written beside a bag that nobody is writing to; SQLite would, of one that keeps a write-ahead log.
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

/// ROS 2 puts /msg between package and name.
std::string ros1_type(std::string type) {
  if (const std::size_t middle = type.find("/msg/"); middle != std::string::npos)
    type.erase(middle, 4);
  return type;
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

bool is_ros2_bag_folder(const path& folder) {
  std::error_code ignored;
  return std::filesystem::exists(folder / kMetadata, ignored) || !bag_files_in(folder).empty();
}

bool is_ros2_bag_file(const path& file) {
  return file.extension() == ".db3" || file.extension() == ".mcap" || file.string().ends_with(".db3.zstd") ||
         starts_with(file, kSqlite) || starts_with(file, kMcap);
}

void Ros2Bag::Closer::operator()(sqlite3* database) const { sqlite3_close(database); }
void Ros2Bag::Closer::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }

Expected<std::unique_ptr<Bag>, std::string> Ros2Bag::open(const path& where) {
  auto bag = std::make_unique<Ros2Bag>();
  std::vector<path> files{where};
  if (std::filesystem::is_directory(where)) {
    Expected<std::vector<path>, std::string> found = files_of(where);
    if (!found)
      return found.error();
    files = std::move(*found);
  }
  if (files.empty())
    return fmt::format("{}: {} names no file; make it again with: ros2 bag reindex", where.string(), kMetadata);
  for (const path& file : files) {
    if (const std::optional<std::string> problem = bag->add(file))
      return fmt::format("{}: {}", file.string(), *problem);
  }
  bag->rewind();
  return std::unique_ptr<Bag>(std::move(bag));
}

/// Opens one more file. What is wrong with it, or nothing.
std::optional<std::string> Ros2Bag::add(const path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    return "no such file; copy the whole bag, or name one of its files";
  if (std::filesystem::file_size(file, ignored) == 0)
    return "the file is empty (0 bytes); record with: ros2 bag record -s sqlite3 /velodyne_packets /imu/data";
  if (starts_with(file, kMcap) || file.extension() == ".mcap")
    return fmt::format("an MCAP bag, which is not read; {}", kConvert);
  if (starts_with(file, kZstd))
    return fmt::format("compressed with zstd, which is not read; {}", kConvert);
  if (!starts_with(file, kSqlite))
    return "not a ROS 2 bag: no SQLite database; copy or record it again";
  sqlite3* opened = nullptr; // what is wrong shows in the first query
  sqlite3_open_v2(uri_of(file).c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
  files_.push_back({file, Database(opened), {}, 0});
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, 1 << 28);                            // no message is so long
  sqlite3_exec(opened, "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr); // else a file that is cut is refused
  return read_topics(files_.back());
}

Ros2Bag::Statement Ros2Bag::prepare(const File& file, const char* sql) {
  sqlite3_stmt* prepared = nullptr;
  sqlite3_prepare_v2(file.database.get(), sql, -1, &prepared, nullptr); // nullptr shows as SQLITE_MISUSE in each step
  return Statement(prepared);
}

std::optional<std::string> Ros2Bag::read_topics(File& file) {
  const auto why = [&] {
    return fmt::format("not a ROS 2 bag, or damaged ({}); copy or record it again",
                       sqlite3_errmsg(file.database.get()));
  };
  const Statement topics = prepare(file, "SELECT id, name, type, serialization_format FROM topics ORDER BY id");
  while (sqlite3_step(topics.get()) == SQLITE_ROW) {
    if (const std::string format = text_of(topics.get(), 3); format != "cdr" && !format.empty()) // early rosbag2: empty
      return fmt::format("its messages are serialised as \"{}\", not cdr; {}", format.substr(0, 20), kConvert);
    file.topic_of[sqlite3_column_int64(topics.get(), 0)] =
        topic_index(text_of(topics.get(), 1), ros1_type(text_of(topics.get(), 2)));
  }
  if (sqlite3_errcode(file.database.get()) != SQLITE_DONE)
    return why();
  const Statement last = prepare(file, "SELECT max(id) FROM messages");
  if (sqlite3_step(last.get()) == SQLITE_ROW)
    file.rows = sqlite3_column_double(last.get(), 0);
  const Statement first = prepare(file, "SELECT data FROM messages ORDER BY id LIMIT 1");
  if (const int status = sqlite3_step(first.get()); status != SQLITE_ROW && status != SQLITE_DONE)
    return why();
  const std::span<const std::byte> data = bytes_of(first.get(), 0);
  if (std::string_view(reinterpret_cast<const char*>(data.data()), data.size()).starts_with(kZstd))
    return fmt::format("its messages are compressed with zstd, which is not read; {}", kConvert);
  return std::nullopt;
}

void Ros2Bag::rewind() {
  rows_.reset();
  current_ = 0;
  row_ = 0;
  timeless_ = 0;
  break_.clear();
}

const BagMessage* Ros2Bag::next() {
  constexpr std::int64_t kMaxNs = 4'000'000'000'000'000'000; // so that differences of stamps cannot overflow
  while (read_row()) {
    const File& file = files_[current_];
    const auto topic = file.topic_of.find(sqlite3_column_int64(rows_.get(), 0));
    const std::int64_t ns = sqlite3_column_int64(rows_.get(), 1);
    const bool has_time = ns >= 0 && ns <= kMaxNs;
    timeless_ += has_time ? 0U : 1U;
    if (topic == file.topic_of.end() || !has_time)
      continue;
    message_ = {topic->second, stamp_from_ns(ns), bytes_of(rows_.get(), 2)};
    return &message_;
  }
  return nullptr;
}

/// Steps to the next row of the current file, or of the next one; false after the last.
bool Ros2Bag::read_row() {
  while (current_ < files_.size()) {
    const File& file = files_[current_];
    if (!rows_) // as players read it; without the index that rosbag2 makes they would be sorted with all their data
      rows_ = prepare(file, "SELECT topic_id, timestamp, data FROM messages INDEXED BY timestamp_idx ORDER BY "
                            "timestamp, id");
    if (!rows_)
      rows_ = prepare(file, "SELECT topic_id, timestamp, data FROM messages ORDER BY id");
    const int status = sqlite3_step(rows_.get());
    if (status == SQLITE_ROW) {
      ++row_;
      return true;
    }
    if (status != SQLITE_DONE)
      break_off(file);
    rows_.reset();
    row_ = 0;
    ++current_;
  }
  return false;
}

void Ros2Bag::break_off(const File& file) {
  break_ = fmt::format("{}: message {}: the database breaks off or is damaged ({}); what lies before it is used",
                       file.path.string(), row_ + 1, sqlite3_errmsg(file.database.get()));
}

std::vector<std::string> Ros2Bag::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty())
    lines.push_back(break_);
  if (timeless_ > 0)
    lines.push_back(fmt::format("{}: {} messages with an absurd time of reception left out; record again if it matters",
                                files_.front().path.string(), timeless_));
  return lines;
}

double Ros2Bag::progress() const {
  if (current_ == files_.size())
    return 1;
  const double rows = files_[current_].rows;
  const double of_file = rows > 0 ? std::min(1.0, static_cast<double>(row_) / rows) : 0;
  return (static_cast<double>(current_) + of_file) / static_cast<double>(files_.size());
}

} // namespace locus::tools
