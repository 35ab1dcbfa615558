// SPDX-License-Identifier: Apache-2.0
#include "bags/ros2_bag.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>
#include <zstd.h>

#include "bags/decompression.hpp"
#include "bags/mcap_bag.hpp"
#include "bags/sqlite_bag.hpp"
#include "unpacking/unpacked_copy.hpp"

namespace locus::tools {
namespace {

using std::filesystem::path;

constexpr const char* kMetadata = "metadata.yaml";
constexpr std::string_view kMcap = "\x89MCAP", kSqlite = "SQLite format 3", kZstd = "\x28\xB5\x2F\xFD";
constexpr std::array<std::string_view, 2> kStorages{".db3", ".mcap"};
constexpr std::array<std::string_view, 3> kPackings{"", ".zstd", ".zst"};

bool starts_with(const path& file, std::string_view magic) {
  std::string start(magic.size(), '\0');
  std::ifstream{file, std::ios::binary}.read(start.data(), static_cast<std::streamsize>(start.size()));
  return start == magic;
}

/// Returns whether a file with these first bytes is supported.
bool begins_a_bag(std::string_view start) { return start.starts_with(kSqlite) || start.starts_with(kMcap); }

bool has_name_of_bag(const path& file) {
  const std::string name = file.filename().string();
  return std::ranges::any_of(kStorages, [&](std::string_view storage) {
    return std::ranges::any_of(
        kPackings, [&](std::string_view packing) { return name.ends_with(fmt::format("{}{}", storage, packing)); });
  });
}

/// Sorts by the numbers that rosbag2 appends to file names. Players leave the uncompressed file next to the compressed
/// one.
std::vector<path> bag_files_in(const path& folder) {
  std::vector<path> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry{folder, error}, end; !error && entry != end; entry.increment(error)) {
    if (has_name_of_bag(entry->path()))
      files.push_back(entry->path());
  }
  std::ranges::sort(files, {}, [](const path& file) { return std::pair(file.native().size(), file); });
  std::erase_if(files, [&](const path& file) {
    return file.extension() != ".db3" && file.extension() != ".mcap" &&
           std::ranges::find(files, path(file).replace_extension()) != files.end();
  });
  return files;
}

/// Returns the files of a folder in recording order, according to its metadata, else by name.
Expected<std::vector<path>, std::string> files_of(const path& folder) {
  const path metadata = folder / kMetadata;
  std::error_code ignored;
  if (!std::filesystem::exists(metadata, ignored))
    return bag_files_in(folder);
  try {
    const YAML::Node bag = YAML::LoadFile(metadata.string())["rosbag2_bagfile_information"];
    const auto storage = bag["storage_identifier"].as<std::string>("");
    const auto compression = bag["compression_format"].as<std::string>("");
    if (!storage.empty() && storage != "sqlite3" &&
        storage != "mcap") // if absent, the first bytes of the files determine the format
      return fmt::format("{}: storage {} is not read; convert it to mcap with: ros2 bag convert", folder.string(),
                         storage);
    if (!compression.empty() && compression != "zstd")
      return fmt::format("{}: compressed with {}, which is not read; convert it to zstd with: ros2 bag convert",
                         folder.string(), compression);
    std::vector<path> files;
    for (const auto& file : bag["relative_file_paths"].as<std::vector<std::string>>())
      files.push_back(folder / path(file).filename()); // some versions prefix the name of the folder
    return files;
  } catch (const YAML::Exception& error) {
    return fmt::format("{}:{}: not written by rosbag2 ({}); recreate it with: ros2 bag reindex", metadata.string(),
                       error.mark.line + 1, error.msg);
  }
}

} // namespace

bool is_ros2_bag_folder(const path& folder) {
  std::error_code ignored;
  return std::filesystem::exists(folder / kMetadata, ignored) || !bag_files_in(folder).empty();
}

bool is_ros2_bag_file(const path& file) {
  return has_name_of_bag(file) || starts_with(file, kSqlite) || starts_with(file, kMcap);
}

Expected<std::unique_ptr<Bag>, std::string> Ros2Bag::open(const path& where) {
  auto bag = std::make_unique<Ros2Bag>();
  bag->name_ = where.string();
  std::vector<path> files{where};
  if (std::filesystem::is_directory(where)) {
    Expected<std::vector<path>, std::string> found = files_of(where);
    if (!found)
      return found.error();
    files = std::move(*found);
  }
  if (files.empty())
    return fmt::format("{}: {} names no file; recreate it with: ros2 bag reindex", where.string(), kMetadata);
  for (const path& file : files) {
    if (const std::optional<std::string> problem = bag->add(file))
      return *problem;
  }
  return std::unique_ptr<Bag>(std::move(bag));
}

/// Opens one more file. Returns the problem, or nothing.
std::optional<std::string> Ros2Bag::add(const path& file) {
  const auto refuse = [&](std::string_view why) { return fmt::format("{}: {}", file.string(), why); };
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    return refuse("no such file; copy the whole bag, or name one of its files");
  if (std::filesystem::file_size(file, ignored) == 0)
    return refuse("the file is empty (0 bytes); record with: ros2 bag record /velodyne_packets /imu/data");
  if (const std::optional<std::string> why = why_unreadable(file))
    return refuse(*why);
  if (!starts_with(file, kZstd))
    return add(file, file);
  Expected<UnpackedCopy, std::string> copy = UnpackedCopy::make(file, begins_a_bag);
  if (!copy)
    return refuse(copy.error());
  if (!copy->problem().empty())
    breaks_.push_back(refuse(copy->problem() + "; what precedes it is used"));
  if (!starts_with(copy->path(), kSqlite))
    return add(file, copy->path());
  const Expected<path, std::string> named = copy->give_name(); // SQLite opens files by name only
  return named ? add(file, *named) : refuse(named.error());
}

/// Opens a file whose uncompressed copy is at `readable`.
std::optional<std::string> Ros2Bag::add(const path& file, const path& readable) {
  const bool is_mcap = starts_with(readable, kMcap);
  if (!is_mcap && !starts_with(readable, kSqlite))
    return fmt::format("{}: not a ROS 2 bag: neither an SQLite database nor MCAP; copy or record it again",
                       file.string());
  Expected<std::unique_ptr<Bag>, std::string> opened =
      is_mcap ? McapBag::open(readable, file.string()) : SqliteBag::open(readable, file.string());
  if (!opened)
    return opened.error();
  files_.push_back({std::move(*opened), {}});
  learn_topics(files_.back());
  return std::nullopt;
}

/// Adds the topics that the file has listed so far.
void Ros2Bag::learn_topics(File& file) {
  for (std::size_t i = file.topic_of.size(); i < file.bag->topics().size(); ++i) {
    const BagTopic& topic = file.bag->topics()[i];
    file.topic_of.push_back(index_of(topic));
  }
}

void Ros2Bag::rewind() {
  for (File& file : files_)
    file.bag->rewind();
  current_ = 0;
  damaged_ = 0;
}

const BagMessage* Ros2Bag::next() {
  while (const BagMessage* message = next_packed()) {
    const std::optional<std::size_t> topic = files_[current_].topic_of[message->topic];
    if (!topic)
      continue;
    message_ = {*topic, message->recorded, message->data};
    const std::string_view data(reinterpret_cast<const char*>(message->data.data()), message->data.size());
    const bool is_packed = data.starts_with(kZstd) && topics()[message_.topic].serialisation == Serialisation::cdr;
    if (!is_packed || unpack()) // CDR itself begins with a zero byte
      return &message_;
    ++damaged_;
  }
  return nullptr;
}

/// Returns the next message as stored in its file.
const BagMessage* Ros2Bag::next_packed() {
  for (; current_ < files_.size(); ++current_) {
    if (const BagMessage* message = files_[current_].bag->next()) {
      learn_topics(files_[current_]);
      return message;
    }
  }
  return nullptr;
}

/// Decompresses the data of message_; false if they are damaged.
bool Ros2Bag::unpack() {
  const auto size = ZSTD_getFrameContentSize(message_.data.data(), message_.data.size()); // may be an error code
  if (size > kMaxBlockBytes)
    return false;
  unpacked_.resize(size);
  const bool is_whole = decompress_zstd(message_.data, unpacked_);
  message_.data = unpacked_;
  return is_whole;
}

std::vector<std::string> Ros2Bag::warnings() const {
  std::vector<std::string> lines = breaks_;
  for (const File& file : files_)
    std::ranges::move(file.bag->warnings(), std::back_inserter(lines));
  if (damaged_ > 0)
    lines.push_back(fmt::format("{}: {} messages are compressed with zstd and damaged, and were skipped; copy or "
                                "record it again",
                                name_, damaged_));
  add_bound_warnings(name_, lines);
  return lines;
}

double Ros2Bag::progress() const {
  if (current_ == files_.size())
    return 1;
  return (static_cast<double>(current_) + files_[current_].bag->progress()) / static_cast<double>(files_.size());
}

} // namespace locus::tools
