// SPDX-License-Identifier: Apache-2.0
// The conformance suite of MCAP's authors: files of every combination of features, each described record by record.
#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <nettle/sha2.h>
#include <nlohmann/json.hpp>

#include "bags/bag.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_data.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

template <class Number> std::string number_bytes(Number value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}
std::string with_length(const std::string& content) {
  return number_bytes(static_cast<std::uint32_t>(content.size())) + content;
}

/// Record of the description: its type, and its fields by name.
class Described {
 public:
  explicit Described(const json& record) : type(record.at("type").get<std::string>()) {
    for (const json& field : record.at("fields"))
      fields_.emplace(field.at(0).get<std::string>(), field.at(1));
  }

  std::string type;

  [[nodiscard]] std::string text(const std::string& name) const { return fields_.at(name).get<std::string>(); }
  [[nodiscard]] std::uint64_t number(const std::string& name) const { return std::stoull(text(name)); }
  [[nodiscard]] std::string u16(const std::string& name) const {
    return number_bytes(static_cast<std::uint16_t>(number(name)));
  }
  [[nodiscard]] std::string u32(const std::string& name) const {
    return number_bytes(static_cast<std::uint32_t>(number(name)));
  }
  [[nodiscard]] std::string u64(const std::string& name) const { return number_bytes(number(name)); }
  [[nodiscard]] std::string string(const std::string& name) const { return with_length(text(name)); }
  [[nodiscard]] std::string data() const {
    std::string bytes;
    for (const json& byte : fields_.at("data"))
      bytes += static_cast<char>(std::stoi(byte.get<std::string>()));
    return bytes;
  }
  /// Returns a map of strings.
  [[nodiscard]] std::string strings(const std::string& name) const {
    std::string all;
    for (const auto& [key, value] : fields_.at(name).items())
      all += with_length(key) + with_length(value.get<std::string>());
    return with_length(all);
  }
  /// Returns a map of numbers, from channels to 64 bits.
  [[nodiscard]] std::string of_channels(const std::string& name) const {
    std::map<int, std::uint64_t> values;
    for (const auto& [key, value] : fields_.at(name).items())
      values[std::stoi(key)] = std::stoull(value.get<std::string>());
    std::string all;
    for (const auto& [channel, value] : values)
      all += number_bytes(static_cast<std::uint16_t>(channel)) + number_bytes(value);
    return with_length(all);
  }

 private:
  std::map<std::string, json> fields_;
};

/// Encodes a record; `padding` follows the fields where the format allows more of them.
std::string encoded(const Described& r, const std::string& padding) {
  if (r.type == "Header")
    return mcap_record(1, r.string("profile") + r.string("library") + padding);
  if (r.type == "Footer")
    return mcap_record(2, r.u64("summary_start") + r.u64("summary_offset_start") + r.u32("summary_crc"));
  if (r.type == "Schema")
    return mcap_record(3, r.u16("id") + r.string("name") + r.string("encoding") + with_length(r.data()) + padding);
  if (r.type == "Channel")
    return mcap_record(4, r.u16("id") + r.u16("schema_id") + r.string("topic") + r.string("message_encoding") +
                              r.strings("metadata") + padding);
  if (r.type == "Message")
    return mcap_record(5,
                       r.u16("channel_id") + r.u32("sequence") + r.u64("log_time") + r.u64("publish_time") + r.data());
  if (r.type == "ChunkIndex")
    return mcap_record(8, r.u64("message_start_time") + r.u64("message_end_time") + r.u64("chunk_start_offset") +
                              r.u64("chunk_length") + r.of_channels("message_index_offsets") +
                              r.u64("message_index_length") + r.string("compression") + r.u64("compressed_size") +
                              r.u64("uncompressed_size") + padding);
  if (r.type == "Attachment") {
    const std::string content = r.u64("log_time") + r.u64("create_time") + r.string("name") + r.string("media_type") +
                                number_bytes(std::uint64_t{r.data().size()}) + r.data();
    return mcap_record(9, content + number_bytes(crc_of(content)) + padding);
  }
  if (r.type == "AttachmentIndex")
    return mcap_record(10, r.u64("offset") + r.u64("length") + r.u64("log_time") + r.u64("create_time") +
                               r.u64("data_size") + r.string("name") + r.string("media_type") + padding);
  if (r.type == "Statistics")
    return mcap_record(11, r.u64("message_count") + r.u16("schema_count") + r.u32("channel_count") +
                               r.u32("attachment_count") + r.u32("metadata_count") + r.u32("chunk_count") +
                               r.u64("message_start_time") + r.u64("message_end_time") +
                               r.of_channels("channel_message_counts") + padding);
  if (r.type == "Metadata")
    return mcap_record(12, r.string("name") + r.strings("metadata") + padding);
  if (r.type == "MetadataIndex")
    return mcap_record(13, r.u64("offset") + r.u64("length") + r.string("name") + padding);
  if (r.type == "SummaryOffset")
    return mcap_record(14, number_bytes(static_cast<std::uint8_t>(r.number("group_opcode"))) + r.u64("group_start") +
                               r.u64("group_length") + padding);
  EXPECT_EQ(r.type, "DataEnd");
  return mcap_record(15, r.u32("data_section_crc"));
}

/// Chunk being filled, and the indices of its messages.
class Chunk {
 public:
  void add(const Described& record) {
    if (record.type == "Channel")
      indices_[static_cast<std::uint16_t>(record.number("id"))];
    if (record.type == "Message") {
      times_.insert(record.number("log_time"));
      indices_[static_cast<std::uint16_t>(record.number("channel_id"))] +=
          record.u64("log_time") + number_bytes(std::uint64_t{records_.size()});
    }
    records_ += encoded(record, "");
  }
  /// Returns the chunk and, if asked for, its message indices; nothing if it is empty.
  [[nodiscard]] std::string closed(bool indexed, const std::string& padding) {
    if (records_.empty())
      return "";
    const std::uint64_t first = times_.empty() ? 0 : *times_.begin(), last = times_.empty() ? 0 : *times_.rbegin();
    std::string all = mcap_record(6, number_bytes(first) + number_bytes(last) +
                                         number_bytes(std::uint64_t{records_.size()}) + number_bytes(crc_of(records_)) +
                                         with_length("") + number_bytes(std::uint64_t{records_.size()}) + records_);
    for (const auto& [channel, entries] : indices_)
      all += indexed ? mcap_record(7, number_bytes(channel) + with_length(entries) + padding) : "";
    records_.clear();
    return all;
  }

 private:
  std::string records_;
  std::set<std::uint64_t> times_;
  std::map<std::uint16_t, std::string> indices_;
};

std::string file_of(const json& description) {
  const auto features = description.at("meta").at("variant").at("features").get<std::set<std::string>>();
  const std::string padding = features.contains("pad") ? "\x01\xff\xff" : "";
  std::string file = mcap_magic();
  Chunk chunk;
  bool is_summary = false;
  for (const json& one : description.at("records")) {
    const Described record(one);
    const bool is_of_chunk = record.type == "Schema" || record.type == "Channel" || record.type == "Message";
    if (features.contains("ch") && is_of_chunk && !is_summary) {
      chunk.add(record);
      continue;
    }
    file += chunk.closed(features.contains("mx"), padding);
    file += encoded(record, padding);
    is_summary = is_summary || record.type == "DataEnd";
  }
  return file + mcap_magic();
}

std::string sha256_of(const std::string& bytes) {
  sha256_ctx context;
  sha256_init(&context);
  sha256_update(&context, bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
  std::array<std::uint8_t, SHA256_DIGEST_SIZE> digest{};
  sha256_digest(&context, digest.size(), digest.data());
  std::string text;
  for (const std::uint8_t byte : digest) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

using Message = std::tuple<std::string, std::uint64_t, std::string>; ///< topic, time, data

/// Returns the messages as described; those of the chunk in the order of their times.
std::vector<Message> described_messages(const json& description) {
  std::map<std::uint64_t, std::string> topics;
  std::vector<Message> messages;
  for (const json& one : description.at("records")) {
    const Described record(one);
    if (record.type == "Channel")
      topics[record.number("id")] = record.text("topic");
    if (record.type == "Message")
      messages.emplace_back(topics.at(record.number("channel_id")), record.number("log_time"), record.data());
  }
  const auto features = description.at("meta").at("variant").at("features").get<std::set<std::string>>();
  if (features.contains("ch"))
    std::ranges::stable_sort(messages, {}, [](const Message& message) { return std::get<1>(message); });
  return messages;
}

std::vector<Message> read_messages(tools::Bag& bag) {
  std::vector<Message> messages;
  while (const tools::BagMessage* message = bag.next())
    messages.emplace_back(bag.topics().at(message->topic).name, static_cast<std::uint64_t>(to_ns(message->recorded)),
                          std::string(reinterpret_cast<const char*>(message->data.data()), message->data.size()));
  return messages;
}

TEST(McapConformance, EveryCombinationOfFeaturesIsReadToTheLastMessage) {
  const std::filesystem::path suite = test_data() / "mcap";
  if (!std::filesystem::exists(suite))
    GTEST_SKIP() << suite << " is not here; set LOCUS_TEST_DATA";
  const TemporaryFolder folder;
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(suite)) {
    if (entry.path().extension() != ".json")
      continue;
    SCOPED_TRACE(entry.path().filename());
    const json description = json::parse(read_text(entry.path()));
    const std::string bytes = file_of(description);
    const std::string pointer = read_text(std::filesystem::path{entry.path()}.replace_extension(".mcap"));
    ASSERT_NE(pointer.find("sha256:" + sha256_of(bytes)), std::string::npos) << "the file is not that of the suite";
    std::ofstream{folder / "suite.mcap", std::ios::binary} << bytes;
    const auto bag = tools::open_bag(folder / "suite.mcap");
    ASSERT_TRUE(bag) << bag.error();
    EXPECT_EQ(read_messages(**bag), described_messages(description));
    EXPECT_EQ((*bag)->warnings(), std::vector<std::string>{});
    ++files;
  }
  EXPECT_EQ(files, 416U);
}

} // namespace
} // namespace locus::test
