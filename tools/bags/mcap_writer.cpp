// SPDX-License-Identifier: Apache-2.0
#include "bags/mcap_writer.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <zstd.h>

#include "locus_replay/failure.hpp"

namespace locus::tools {
namespace {

constexpr std::size_t kChunkBytes = 1 << 20;
constexpr const char* kCompression = "zstd";

std::uint64_t ns_of(Stamp stamp) { return static_cast<std::uint64_t>(std::max<std::int64_t>(0, to_ns(stamp))); }

McapBytes pairs(const std::map<std::uint16_t, std::uint64_t>& values) {
  McapBytes all;
  for (const auto& [key, value] : values)
    all.number(key).number(value);
  return all;
}

} // namespace

McapBytes& McapBytes::bytes(std::span<const std::byte> more) {
  all_.insert(all_.end(), more.begin(), more.end());
  return *this;
}

McapBytes& McapBytes::sequence(std::span<const std::byte> more) {
  return number(static_cast<std::uint32_t>(more.size())).bytes(more);
}

McapBytes& McapBytes::record(McapOp op, const McapBytes& content) {
  return number(static_cast<std::uint8_t>(op)).number(std::uint64_t{content.size()}).bytes(content.all());
}

McapWriter::McapWriter(const std::filesystem::path& file) : file_(file) {
  put(std::as_bytes(std::span{kMcapMagic}));
  put(McapOp::header, McapBytes().text("ros2").text("locusd"));
}

void McapWriter::put(McapOp op, const McapBytes& content) { put(McapBytes().record(op, content).all()); }

void McapWriter::put(std::span<const std::byte> bytes) {
  file_.write(bytes);
  at_ += bytes.size();
}

std::uint16_t McapWriter::add(const Topic& topic) {
  const auto id = static_cast<std::uint16_t>(messages_.size() + 1);
  messages_[id] = 0;
  McapBytes metadata;
  metadata.text("offered_qos_profiles").text("");
  if (!topic.hash.empty())
    metadata.text("topic_type_hash").text(topic.hash);
  const McapBytes schema = McapBytes().number(id).text(topic.type).text("ros2msg").text(topic.definition);
  const McapBytes channel = McapBytes().number(id).number(id).text(topic.name).text("cdr").sequence(metadata.all());
  schemas_.record(McapOp::schema, schema);
  channels_.record(McapOp::channel, channel);
  records_.record(McapOp::schema, schema).record(McapOp::channel, channel);
  return id;
}

void McapWriter::write(std::uint16_t channel, Stamp stamp, std::span<const std::byte> message) {
  const std::uint64_t ns = ns_of(stamp);
  chunk_.first_ns = times_.empty() ? ns : std::min(chunk_.first_ns, ns);
  chunk_.last_ns = times_.empty() ? ns : std::max(chunk_.last_ns, ns);
  times_[channel].number(ns).number(std::uint64_t{records_.size()});
  const auto sequence = static_cast<std::uint32_t>(messages_[channel]++);
  records_.record(McapOp::message, McapBytes().number(channel).number(sequence).number(ns).number(ns).bytes(message));
  if (records_.size() >= kChunkBytes)
    finish_chunk();
}

void McapWriter::finish_chunk() {
  if (records_.size() == 0)
    return;
  packed_.resize(ZSTD_compressBound(records_.size()));
  const std::span<const std::byte> records = records_.all();
  const std::size_t size = ZSTD_compress(packed_.data(), packed_.size(), records.data(), records.size(), 1);
  if (ZSTD_isError(size) != 0)
    throw Failure(ExitStatus::failed, fmt::format("{}: a chunk cannot be compressed ({}); free memory, and run again",
                                                  file_.path().string(), ZSTD_getErrorName(size)));
  packed_.resize(size);
  chunk_.begin = at_;
  chunk_.size = records.size();
  chunk_.packed_size = packed_.size();
  McapBytes content;
  content.number(chunk_.first_ns).number(chunk_.last_ns).number(chunk_.size).number(mcap_crc(records));
  content.text(kCompression).number(chunk_.packed_size).bytes(packed_);
  put(McapOp::chunk, content);
  chunk_.length = at_ - chunk_.begin;
  put_indices(chunk_);
  chunks_.push_back(std::exchange(chunk_, {}));
  records_.clear();
  times_.clear();
}

void McapWriter::put_indices(Chunk& chunk) {
  const std::uint64_t begin = at_;
  for (const auto& [channel, times] : times_) {
    chunk.index_of[channel] = at_;
    put(McapOp::message_index, McapBytes().number(channel).sequence(times.all()));
  }
  chunk.indices_length = at_ - begin;
}

McapBytes McapWriter::statistics() const {
  const auto channels = static_cast<std::uint32_t>(messages_.size());
  std::uint64_t count = 0, first_ns = 0, last_ns = 0;
  for (const auto& [channel, messages] : messages_)
    count += messages;
  for (const Chunk& chunk : chunks_) {
    first_ns = &chunk == &chunks_.front() ? chunk.first_ns : std::min(first_ns, chunk.first_ns);
    last_ns = std::max(last_ns, chunk.last_ns);
  }
  McapBytes all;
  all.number(count).number(static_cast<std::uint16_t>(channels)).number(channels);
  all.number(std::uint32_t{0}).number(std::uint32_t{0}); // attachments, metadata
  all.number(static_cast<std::uint32_t>(chunks_.size())).number(first_ns).number(last_ns);
  return all.sequence(pairs(messages_).all());
}

void McapWriter::put_summary() {
  McapBytes figures, chunks, summary, offsets;
  figures.record(McapOp::statistics, statistics());
  for (const Chunk& chunk : chunks_) {
    McapBytes content;
    content.number(chunk.first_ns).number(chunk.last_ns).number(chunk.begin).number(chunk.length);
    content.sequence(pairs(chunk.index_of).all()).number(chunk.indices_length);
    content.text(kCompression).number(chunk.packed_size).number(chunk.size);
    chunks.record(McapOp::chunk_index, content);
  }
  for (const auto& [op, group] : {std::pair{McapOp::schema, &schemas_}, std::pair{McapOp::channel, &channels_},
                                  std::pair{McapOp::statistics, &figures}, std::pair{McapOp::chunk_index, &chunks}}) {
    if (group->size() == 0)
      continue;
    McapBytes offset;
    offset.number(static_cast<std::uint8_t>(op)).number(at_ + summary.size()).number(std::uint64_t{group->size()});
    offsets.record(McapOp::summary_offset, offset);
    summary.bytes(group->all());
  }
  McapBytes footer;
  footer.number(at_).number(at_ + summary.size());
  summary.bytes(offsets.all());
  McapBytes head = summary; // the checksum covers all bytes before it
  head.number(static_cast<std::uint8_t>(McapOp::footer)).number(std::uint64_t{kMcapFooterBytes - kMcapRecordHead});
  head.bytes(footer.all());
  put(summary.all());
  put(McapOp::footer, footer.number(mcap_crc(head.all())));
}

void McapWriter::close() {
  finish_chunk();
  put(McapOp::data_end, McapBytes().number(std::uint32_t{0})); // a checksum of all data is optional
  put_summary();
  put(std::as_bytes(std::span{kMcapMagic}));
  file_.close();
}

} // namespace locus::tools
