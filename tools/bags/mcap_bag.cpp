// SPDX-License-Identifier: Apache-2.0
#include "bags/mcap_bag.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "bags/decompression.hpp"
#include "bags/reception_order.hpp"

namespace locus::tools {
namespace {

/// Channel and time of reception of a message; 0 if it is too short.
struct MessageHead {
  std::uint16_t channel;
  std::uint64_t log_time_ns;

  static MessageHead of(const McapRecord& message) {
    MessageReader fields = message.fields();
    const auto channel = fields.number<std::uint16_t>();
    fields.bytes(sizeof(std::uint32_t)); // sequence number
    return {channel, fields.number<std::uint64_t>()};
  }
};

} // namespace

McapBag::McapBag(const std::filesystem::path& file, std::string name)
    : name_(std::move(name)), stream_(file, std::ios::binary) {
  std::error_code ignored;
  size_ = std::filesystem::file_size(file, ignored);
}

Expected<std::unique_ptr<Bag>, std::string> McapBag::open(const std::filesystem::path& file, std::string name) {
  std::unique_ptr<McapBag> bag(new McapBag(file, std::move(name)));
  if (const std::optional<std::string> problem = bag->stream_ ? bag->read_magic() : why_unreadable(file))
    return fmt::format("{}: {}", bag->name_, *problem);
  bag->is_closed_ = bag->read_footer().has_value();
  if (!bag->read_topics_from_summary()) {
    bag->rewind();
    while (bag->next() != nullptr) {
    }
    if (bag->topics().empty() && !bag->warnings().empty())
      return bag->warnings().front();
  }
  bag->rewind();
  return std::unique_ptr<Bag>(std::move(bag));
}

std::optional<std::string> McapBag::read_magic() {
  std::array<char, kMcapMagic.size()> start{};
  const bool is_there = read_at(0, std::as_writable_bytes(std::span{start}));
  if (is_there && std::string_view(start.data(), start.size()) == kMcapMagic)
    return std::nullopt;
  if (is_there && std::string_view(start.data(), start.size()).starts_with("\x89MCAP"))
    return "MCAP of another version than 0; record again with a current rosbag2";
  return "not an MCAP file: it does not begin as one; copy or record it again";
}

/// Reads the last record; nothing if the recorder did not get to write it.
std::optional<McapFooter> McapBag::read_footer() {
  std::array<std::byte, kMcapFooterBytes + kMcapMagic.size()> end{};
  if (size_ < kMcapMagic.size() + end.size() || !read_at(size_ - end.size(), end))
    return std::nullopt;
  std::span<const std::byte> bytes(end);
  const std::optional<McapRecord> record = pop_mcap_record(bytes);
  const std::string_view magic(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return record && magic == kMcapMagic ? McapFooter::read(*record) : std::nullopt;
}

/// Returns false without a complete summary that lists all channels.
bool McapBag::read_topics_from_summary() {
  constexpr std::size_t kBehindCrc = sizeof(std::uint32_t);
  const std::optional<McapFooter> footer = read_footer();
  const std::uint64_t end = size_ - kMcapMagic.size();
  if (!footer || footer->summary_start < kMcapMagic.size() || footer->summary_start >= end - kMcapFooterBytes ||
      end - footer->summary_start > kMaxBlockBytes)
    return false;
  record_.resize(end - footer->summary_start);
  if (!read_at(footer->summary_start, record_))
    return false;
  std::span<const std::byte> bytes(record_);
  if (footer->summary_crc != 0 && mcap_crc(bytes.first(bytes.size() - kBehindCrc)) != footer->summary_crc)
    return false;
  return accept_summary(bytes.first(bytes.size() - kMcapFooterBytes));
}

/// Returns false if a channel, or the schema of one, is missing: writers may omit either.
bool McapBag::accept_summary(std::span<const std::byte> summary) {
  std::vector<McapRecord> channels;
  std::optional<std::uint32_t> count;
  while (const std::optional<McapRecord> record = pop_mcap_record(summary)) {
    MessageReader fields = record->fields();
    if (record->op == McapOp::schema)
      accept_schema(*record);
    else if (record->op == McapOp::channel)
      channels.push_back(*record);
    else if (record->op == McapOp::statistics && !fields.bytes(sizeof(std::uint64_t) + sizeof(std::uint16_t)).empty())
      count = fields.number<std::uint32_t>();
  }
  const auto is_whole = [&](const McapRecord& record) {
    const std::optional<McapChannel> channel = McapChannel::read(record);
    return channel && (channel->schema == 0 || schemas_.contains(channel->schema));
  };
  if (count != channels.size() || !std::ranges::all_of(channels, is_whole)) {
    schemas_.clear();
    return false;
  }
  for (const McapRecord& channel : channels)
    accept_channel(channel);
  return true;
}

bool McapBag::read_at(std::uint64_t place, std::span<std::byte> bytes) {
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(place));
  stream_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return stream_.good();
}

/// Frees the memory of this file: a folder may hold many, which are read one at a time.
void McapBag::free_memory() {
  records_ = {};
  next_ = 0;
  std::vector<std::uint32_t>().swap(messages_);
  for (std::vector<std::byte>* const room : {&record_, &chunk_})
    std::vector<std::byte>().swap(*room);
}

void McapBag::rewind() {
  free_memory();
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(kMcapMagic.size()));
  at_ = kMcapMagic.size();
  is_over_ = false;
  timeless_ = left_out_ = 0;
  first_left_out_.clear();
  break_.clear();
}

const BagMessage* McapBag::next() {
  while (const std::optional<McapRecord> record = next_record()) {
    if (accept(*record))
      return &message_;
  }
  free_memory();
  return nullptr;
}

/// Returns the next message of the current chunk, else the next record of the file; nothing at the end or where the
/// file is truncated.
std::optional<McapRecord> McapBag::next_record() {
  if (next_ == messages_.size())
    return read_record();
  std::span<const std::byte> rest = records_.subspan(messages_[next_++]);
  return pop_mcap_record(rest);
}

/// Reads the next relevant record of the file.
std::optional<McapRecord> McapBag::read_record() {
  while (!is_over_ && at_ < size_) {
    place_ = at_;
    std::array<std::byte, kMcapRecordHead> head{};
    stream_.read(reinterpret_cast<char*>(head.data()), head.size());
    MessageReader fields(head, Serialisation::ros1);
    const auto op = static_cast<McapOp>(fields.number<std::uint8_t>());
    const auto length = fields.number<std::uint64_t>();
    const std::uint64_t left = size_ - at_;
    if (!stream_ || op == McapOp::none || left < head.size() || length > left - head.size())
      return break_off();
    at_ += head.size() + length;
    is_over_ = op == McapOp::data_end || op == McapOp::footer;
    const bool is_of_use =
        op == McapOp::schema || op == McapOp::channel || op == McapOp::message || op == McapOp::chunk;
    const bool fits = length <= kMaxBlockBytes;
    if (is_of_use && !fits)
      leave_out(fmt::format("it has {} bytes, more than {}", length, kMaxBlockBytes));
    record_.resize(is_of_use && fits ? length : 0);
    if (record_.empty())
      stream_.seekg(static_cast<std::streamoff>(length), std::ios::cur);
    else if (stream_.read(reinterpret_cast<char*>(record_.data()), static_cast<std::streamsize>(length)))
      return McapRecord{op, record_};
    if (!stream_)
      return break_off();
  }
  return std::nullopt;
}

/// Processes a record; returns whether it yields a message.
bool McapBag::accept(const McapRecord& record) {
  if (record.op == McapOp::schema)
    accept_schema(record);
  else if (record.op == McapOp::channel)
    accept_channel(record);
  else if (record.op == McapOp::chunk)
    open_chunk(record);
  return record.op == McapOp::message && accept_message(record);
}

void McapBag::accept_schema(const McapRecord& record) {
  if (std::optional<McapSchema> schema = McapSchema::read(record))
    schemas_[schema->id] = schema->name.substr(0, kMaxNameBytes + 1); // still rejected if too long
}

void McapBag::accept_channel(const McapRecord& record) {
  const std::optional<McapChannel> channel = McapChannel::read(record);
  if (!channel)
    return;
  const auto schema = schemas_.find(channel->schema);
  std::string type = schema != schemas_.end() ? ros1_type(schema->second) : "no schema";
  if (channel->encoding != "cdr" && channel->encoding != "ros1")
    type += " as " + channel->encoding;
  declare(channel->id, {channel->topic, type, channel->encoding == "ros1" ? Serialisation::ros1 : Serialisation::cdr});
}

/// Processes the schemas and channels of a chunk, and sorts its messages by time, unless the recorder's clock was set
/// back: writers with several threads store them as they come.
void McapBag::open_chunk(const McapRecord& record) {
  const McapChunkRecords chunk = unpack_mcap_chunk(record, chunk_);
  if (!chunk.problem.empty())
    leave_out(chunk.problem);
  records_ = chunk.bytes;
  messages_.clear();
  next_ = 0;
  ReceptionOrder order;
  for (std::span<const std::byte> left = records_; !left.empty();) {
    const auto offset = static_cast<std::uint32_t>(records_.size() - left.size());
    const std::optional<McapRecord> inner = pop_mcap_record(left);
    if (!inner || inner->op == McapOp::chunk) {
      leave_out("the records in it are damaged");
      break;
    }
    if (inner->op != McapOp::message) {
      accept(*inner);
      continue;
    }
    messages_.push_back(offset);
    const auto [channel, log_time_ns] = MessageHead::of(*inner);
    if (log_time_ns <= static_cast<std::uint64_t>(kMaxBagTime_ns))
      order.add(channel, static_cast<std::int64_t>(log_time_ns));
  }
  if (order.is_that_of_the_file())
    return;
  std::ranges::stable_sort(messages_, {}, [&](std::uint32_t offset) {
    std::span<const std::byte> rest = records_.subspan(offset);
    return MessageHead::of(*pop_mcap_record(rest)).log_time_ns;
  });
}

/// Returns false for a message without a known channel or a valid time.
bool McapBag::accept_message(const McapRecord& record) {
  MessageReader fields = record.fields();
  const std::optional<std::size_t> topic = topic_of(fields.number<std::uint16_t>());
  const std::uint64_t recorded_ns = MessageHead::of(record).log_time_ns;
  fields.bytes(sizeof(std::uint32_t) + 2 * sizeof(std::uint64_t)); // sequence number, times of reception and sending
  const bool has_time = recorded_ns <= static_cast<std::uint64_t>(kMaxBagTime_ns);
  timeless_ += has_time ? 0U : 1U;
  if (!fields.whole() || !topic || !has_time)
    return false;
  message_ = {*topic, stamp_from_ns(static_cast<std::int64_t>(recorded_ns)), fields.rest()};
  return true;
}

std::nullopt_t McapBag::break_off() {
  is_over_ = true;
  break_ =
      fmt::format("{}: byte {}: the file ends in mid-record, or is damaged; what precedes it is used", name_, place_);
  return std::nullopt;
}

void McapBag::leave_out(const std::string& why) {
  if (left_out_++ == 0)
    first_left_out_ = fmt::format("byte {}: {}", place_, why);
}

std::vector<std::string> McapBag::warnings() const {
  std::vector<std::string> lines;
  if (!break_.empty())
    lines.push_back(break_);
  else if (!is_closed_)
    lines.push_back(
        fmt::format("{}: was not closed by its recorder and has no index; all {} bytes are used, but the end "
                    "may be missing; mcap recover repairs it for other programs",
                    name_, size_));
  if (left_out_ > 0)
    lines.push_back(fmt::format("{}: {} chunks or records cannot be read and were skipped, the first at {}; "
                                "copy or record it again",
                                name_, left_out_, first_left_out_));
  if (timeless_ > 0)
    lines.push_back(timeless_messages(name_, timeless_));
  add_bound_warnings(name_, lines);
  return lines;
}

double McapBag::progress() const { return static_cast<double>(at_) / static_cast<double>(size_); }

} // namespace locus::tools
