// SPDX-License-Identifier: Apache-2.0
#include "bags/ros1_bag.hpp"

#include <array>
#include <utility>

#include <fmt/format.h>

#include "bags/decompression.hpp"

namespace locus::tools {
namespace {

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

} // namespace

Ros1Bag::Ros1Bag(std::filesystem::path file) : file_(std::move(file)), stream_(file_, std::ios::binary) {
  std::error_code ignored;
  size_ = std::filesystem::file_size(file_, ignored);
}

Expected<std::unique_ptr<Bag>, std::string> Ros1Bag::open(const std::filesystem::path& file) {
  std::unique_ptr<Ros1Bag> bag(new Ros1Bag(file));
  if (std::optional<std::string> problem = bag->read_start())
    return fmt::format("{}: {}", file.string(), *problem);
  if (!bag->read_topics_from_index()) {
    bag->rewind();
    while (bag->next() != nullptr) {
    }
  }
  bag->rewind();
  return std::unique_ptr<Bag>(std::move(bag));
}

/// Reads the magic and the header of the bag. Returns the problem, or nothing.
std::optional<std::string> Ros1Bag::read_start() {
  if (!stream_)
    return why_unreadable(file_).value_or("cannot be read");
  if (size_ == 0)
    return "the file is empty (0 bytes); record with: rosbag record /velodyne_packets /imu/data";
  std::array<char, kMagic.size()> start{};
  stream_.read(start.data(), start.size());
  const std::string_view magic(start.data(), static_cast<std::size_t>(stream_.gcount()));
  if (!magic.starts_with("#ROSBAG V"))
    return "not a ROS 1 bag, its first bytes are not #ROSBAG V2.0; name one that rosbag info reads";
  if (magic != kMagic)
    return "a bag of another format than 2.0; convert it with: rosbag reindex, then rosbag fix";
  at_ = kMagic.size();
  const std::optional<BagRecord> header = read_record();
  if (!header || header->fields.op() != BagOp::bag_header)
    return "the header of the bag is damaged; copy or record it again";
  if (!header->fields.text("encryptor").empty())
    return "the bag is encrypted; decrypt it with: rosbag decrypt";
  index_ = header->fields.number<std::uint64_t>("index_pos").value_or(0);
  first_record_ = at_;
  return std::nullopt;
}

/// Returns false without a complete index.
bool Ros1Bag::read_topics_from_index() {
  if (index_ < first_record_ || index_ > size_)
    return false;
  go_to(index_);
  std::optional<BagRecord> record = next_record();
  for (; record && record->fields.op() == BagOp::connection; record = next_record())
    add_connection(*record);
  return break_.empty();
}

void Ros1Bag::rewind() { go_to(first_record_); }

void Ros1Bag::go_to(std::uint64_t place) {
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(place));
  at_ = place;
  left_ = {};
  break_.clear();
}

const BagMessage* Ros1Bag::next() {
  while (const std::optional<BagRecord> record = next_record()) {
    if (record->fields.op() == BagOp::chunk)
      open_chunk(*record);
    else if (record->fields.op() == BagOp::connection)
      add_connection(*record);
    else if (record->fields.op() == BagOp::message && accept_message(*record))
      return &message_;
  }
  return nullptr;
}

/// Reads from the current chunk, else from the file; nothing at the end or where the file is truncated.
std::optional<BagRecord> Ros1Bag::next_record() {
  if (left_.empty())
    return at_ < size_ && break_.empty() ? read_record() : std::nullopt;
  const std::optional<BagRecord> record = pop_record(left_);
  if (record && record->fields.op() != BagOp::chunk)
    return record;
  left_ = {};
  break_off("a chunk is damaged");
  return std::nullopt;
}

std::optional<BagRecord> Ros1Bag::read_record() {
  const std::uint64_t begin = at_;
  const std::optional<BagOp> op = read_block(header_) ? BagFields(header_).op() : std::nullopt;
  const bool passed_over = op == BagOp::index || op == BagOp::chunk_info;
  data_.clear();
  if (op && (passed_over ? skip_block() : read_block(data_)))
    return BagRecord{BagFields(header_), data_};
  at_ = begin;
  break_off("the bag ends in mid-record, or is damaged");
  return std::nullopt;
}

/// Reads the length of the next block; nothing if it exceeds the rest of the file.
std::optional<std::uint32_t> Ros1Bag::read_length() {
  std::uint32_t length = 0;
  stream_.read(reinterpret_cast<char*>(&length), sizeof(length));
  if (!stream_ || length > kMaxBlockBytes || sizeof(length) + length > size_ - at_)
    return std::nullopt;
  at_ += sizeof(length) + length;
  return length;
}

bool Ros1Bag::read_block(std::vector<std::byte>& block) {
  const std::optional<std::uint32_t> length = read_length();
  block.resize(length.value_or(0));
  stream_.read(reinterpret_cast<char*>(block.data()), static_cast<std::streamsize>(block.size()));
  return length && stream_;
}

bool Ros1Bag::skip_block() {
  const std::optional<std::uint32_t> length = read_length();
  return length && stream_.seekg(*length, std::ios::cur);
}

void Ros1Bag::open_chunk(const BagRecord& chunk) {
  if (const std::optional<std::string> problem = decompress_chunk(chunk, chunk_))
    break_off(*problem);
  else
    left_ = chunk_;
}

void Ros1Bag::add_connection(const BagRecord& connection) {
  if (const auto id = connection.fields.number<std::uint32_t>("conn"))
    declare(*id, {std::string(connection.fields.text("topic")), std::string(BagFields(connection.data).text("type")),
                  Serialisation::ros1});
}

/// Returns false for a message without a known connection.
bool Ros1Bag::accept_message(const BagRecord& message) {
  struct Time {
    std::uint32_t seconds, nanoseconds;
  };
  const auto connection = message.fields.number<std::uint32_t>("conn");
  const auto time = message.fields.number<Time>("time");
  const std::optional<std::size_t> topic = connection ? topic_of(*connection) : std::nullopt;
  if (!topic || !time)
    return false;
  message_ = {*topic, Stamp{std::chrono::seconds{time->seconds} + Duration{time->nanoseconds}}, message.data};
  return true;
}

void Ros1Bag::break_off(const std::string& why) {
  break_ = fmt::format("{}: byte {}: {}; what precedes it is used", file_.string(), at_, why);
}

std::vector<std::string> Ros1Bag::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty())
    lines.push_back(break_);
  else if (index_ == 0)
    lines.push_back(
        fmt::format("{}: was not closed by its recorder and has no index; all {} bytes are used, but the end may be "
                    "missing; rosbag reindex repairs it for other programs",
                    file_.string(), size_));
  add_bound_warnings(file_.string(), lines);
  return lines;
}

double Ros1Bag::progress() const { return static_cast<double>(at_) / static_cast<double>(size_); }

} // namespace locus::tools
