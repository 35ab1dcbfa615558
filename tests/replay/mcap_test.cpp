// SPDX-License-Identifier: Apache-2.0
// Replay of MCAP files, valid and damaged.
#include <algorithm>
#include <fstream>

#include <malloc.h>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "bags/bag.hpp"
#include "bags/messages.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream{file, std::ios::binary} << bytes;
}

std::string odometry_of(const std::string& recording, RosVersion ros = RosVersion::ros2) {
  std::vector<std::string> arguments{"-c", room_drive() / "config.yaml", recording};
  const Replay replay(arguments);
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "") << static_cast<int>(ros);
  return read_text(replay.file("odometry.csv"));
}

class McapDrive : public testing::TestWithParam<McapForm> {};

TEST_P(McapDrive, GivesTheBitsOfTheDatabaseAndOfTheRos1Bag) {
  const TemporaryFolder folder;
  const std::vector<RecordedMessage> ros1 = messages_of(room_drive(), RosVersion::ros1),
                                     ros2 = messages_of(room_drive(), RosVersion::ros2);
  write_db3(folder / "drive.db3", ros2);
  write_bytes(folder / "drive.bag", ros1_bag(ros1));
  write_bytes(folder / "drive.mcap", mcap_file(ros2, RosVersion::ros2, GetParam()));
  write_bytes(folder / "ros1.mcap", mcap_file(ros1, RosVersion::ros1, GetParam()));
  const std::string odometry = odometry_of(folder / "drive.db3");
  EXPECT_GT(odometry.size(), 10'000U);
  for (const char* const file : {"drive.bag", "drive.mcap", "ros1.mcap"})
    EXPECT_TRUE(odometry_of(folder / file) == odometry) << file;
}
INSTANTIATE_TEST_SUITE_P(Forms, McapDrive,
                         testing::Values(McapForm{}, McapForm{.compression = McapCompression::lz4},
                                         McapForm{.compression = McapCompression::zstd}, McapForm{.chunked = false},
                                         McapForm{.compression = McapCompression::zstd, .summary = false}));

TEST(Mcap, UnclosedFileIsReadToItsEndAndReported) {
  const TemporaryFolder folder;
  const std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  write_bytes(folder / "whole.mcap", mcap_file(messages, RosVersion::ros2));
  write_bytes(folder / "open.mcap", mcap_file(messages, RosVersion::ros2, {.closed = false}));
  const std::vector<std::string> arguments{"-c", room_drive() / "config.yaml", folder / "open.mcap"};
  const Replay replay(arguments);
  EXPECT_EQ(replay.run().status, 0);
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "open.mcap: was not closed by its recorder")) << replay.run().err;
  EXPECT_TRUE(read_text(replay.file("odometry.csv")) == odometry_of(folder / "whole.mcap"));
}

/// Each message is less than half a second older than the one before it.
TEST(Mcap, MessagesGoingBackBySmallStepsAreReportedOutOfOrder) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  std::erase_if(messages, [](const RecordedMessage& m) { return !m.topic.ends_with("packets"); });
  constexpr std::size_t kBlock = 10;
  for (std::size_t i = 0; i + kBlock <= messages.size(); i += kBlock)
    std::ranges::reverse(std::span(messages).subspan(i, kBlock));
  write_bytes(folder / "backwards.mcap", mcap_file(messages, RosVersion::ros2, {.chunked = false}));
  const Replay replay({"-c", room_drive() / "config.yaml", folder / "backwards.mcap"});
  EXPECT_TRUE(contains(replay.run().err, "messages follow one that was received later")) << replay.run().err;
}

TEST(Mcap, FolderOfSeveralFilesIsReadInTheOrderOfItsMetadata) {
  const TemporaryFolder folder;
  const std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  const std::span<const RecordedMessage> all(messages);
  const auto part = [&](const std::string& name, std::size_t begin, std::size_t end) {
    write_bytes(folder / name,
                mcap_file(all.subspan(begin, end - begin), RosVersion::ros2, {.compression = McapCompression::zstd}));
  };
  write_bytes(folder / "one.mcap.whole", mcap_file(messages, RosVersion::ros2));
  const std::string odometry = odometry_of(folder / "one.mcap.whole");
  const std::size_t third = messages.size() / 3;
  part("b.mcap", 0, third);
  part("a.mcap", third, 2 * third);
  part("c.mcap", 2 * third, messages.size());
  std::filesystem::remove(folder / "one.mcap.whole");
  write_bytes(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  storage_identifier: mcap\n"
                                        "  relative_file_paths:\n    - drive/b.mcap\n    - a.mcap\n    - c.mcap\n"
                                        "  compression_format: \"\"\n  compression_mode: \"\"\n");
  EXPECT_TRUE(odometry_of(folder.path()) == odometry);
}

/// Without metadata the numbers at the end of the file names determine the order.
TEST(Mcap, FolderWithoutMetadataIsReadInTheOrderOfItsNumbers) {
  const TemporaryFolder folder;
  const std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  constexpr std::size_t kFiles = 11;
  for (std::size_t i = 0; i < kFiles; ++i) {
    const std::size_t begin = i * messages.size() / kFiles, end = (i + 1) * messages.size() / kFiles;
    write_bytes(folder / ("drive_" + std::to_string(i) + ".mcap"),
                mcap_file(std::span(messages).subspan(begin, end - begin), RosVersion::ros2));
  }
  const TemporaryFolder other;
  write_bytes(other / "drive.mcap", mcap_file(messages, RosVersion::ros2));
  EXPECT_TRUE(odometry_of(folder.path()) == odometry_of(other / "drive.mcap"));
}

/// Small files of two topics with three messages each.
class SmallMcap : public testing::Test {
 protected:
  struct Read {
    std::vector<std::string> messages; ///< "TOPIC TIME DATA" each
    std::vector<std::string> topics;   ///< "NAME TYPE" each
    std::vector<std::string> warnings;
    std::string error;
  };

  Read read(const std::string& bytes) {
    write_bytes(folder_ / "small.mcap", bytes);
    const auto bag = tools::open_bag(folder_ / "small.mcap");
    Read result;
    if (!bag) {
      result.error = bag.error();
      EXPECT_TRUE(contains(result.error, "small.mcap: ")) << result.error;
      EXPECT_EQ(result.error.find('\n'), std::string::npos);
      return result;
    }
    while (const tools::BagMessage* message = (*bag)->next()) {
      const std::string data(reinterpret_cast<const char*>(message->data.data()), message->data.size());
      result.messages.push_back((*bag)->topics().at(message->topic).name + " " +
                                std::to_string(to_ns(message->recorded)) + " " + data);
      EXPECT_LE((*bag)->progress(), 1.0);
    }
    for (const tools::BagTopic& topic : (*bag)->topics())
      result.topics.push_back(topic.name + " " + topic.type);
    result.warnings = (*bag)->warnings();
    std::size_t again = 0;
    for ((*bag)->rewind(); (*bag)->next() != nullptr;)
      ++again;
    EXPECT_EQ(again, result.messages.size());
    return result;
  }

  static std::string declarations() {
    return mcap_schema(1, "sensor_msgs/msg/Imu") + mcap_channel(1, 1, "/imu") +
           mcap_schema(2, "nav_msgs/msg/Odometry") + mcap_channel(2, 2, "/odom");
  }
  static std::string records() {
    std::string all = declarations();
    for (std::uint64_t i = 0; i < 3; ++i)
      all +=
          mcap_message(1, 10 * i, "imu" + std::to_string(i)) + mcap_message(2, 10 * i + 5, "odom" + std::to_string(i));
    return all;
  }
  static std::string head() { return mcap_magic() + mcap_header(); }
  static std::string closed(const std::string& body) { return head() + body + mcap_end(head() + body); }

  void expect_all(const Read& read) {
    EXPECT_EQ(read.error, "");
    EXPECT_EQ(read.messages, kAll);
    EXPECT_EQ(read.topics, (std::vector<std::string>{"/imu sensor_msgs/Imu", "/odom nav_msgs/Odometry"}));
  }
  void expect_warning(const Read& read, const std::vector<std::string>& parts) {
    ASSERT_EQ(read.warnings.size(), 1U);
    for (const std::string& part : parts)
      EXPECT_TRUE(contains(read.warnings[0], part)) << read.warnings[0];
  }

  const std::vector<std::string> kAll{"/imu 0 imu0",    "/odom 5 odom0", "/imu 10 imu1",
                                      "/odom 15 odom1", "/imu 20 imu2",  "/odom 25 odom2"};
  TemporaryFolder folder_;
};

TEST_F(SmallMcap, IsReadInEveryForm) {
  for (const McapCompression compression : {McapCompression::none, McapCompression::lz4, McapCompression::zstd}) {
    const Read whole = read(closed(mcap_chunk(records(), compression)));
    expect_all(whole);
    EXPECT_TRUE(whole.warnings.empty());
  }
  const Read without_chunks = read(closed(records()));
  expect_all(without_chunks);
  EXPECT_TRUE(without_chunks.warnings.empty());
}

/// Writers with several threads store messages as they come; the index, which players use, is by time.
TEST_F(SmallMcap, MessagesOfAChunkComeInTheOrderOfTheirTimes) {
  std::string mixed;
  for (const int i : {2, 0, 1})
    mixed += mcap_message(2, static_cast<std::uint64_t>(10 * i + 5), "odom" + std::to_string(i)) +
             mcap_message(1, static_cast<std::uint64_t>(10 * i), "imu" + std::to_string(i));
  for (const McapCompression compression : {McapCompression::none, McapCompression::zstd}) {
    const Read sorted = read(closed(mcap_chunk(declarations() + mixed, compression)));
    expect_all(sorted);
    EXPECT_TRUE(sorted.warnings.empty());
  }
}

TEST_F(SmallMcap, CutAtAnyByteIsReadUpToTheCut) {
  for (const std::string& body : {records(), mcap_chunk(records(), McapCompression::zstd) +
                                                 mcap_chunk(mcap_message(1, 30, "imu3"), McapCompression::lz4)}) {
    const std::string whole = closed(body);
    const std::size_t messages = read(whole).messages.size();
    std::size_t before = 0;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      SCOPED_TRACE(size);
      const Read cut = read(whole.substr(0, size));
      EXPECT_GE(cut.messages.size(), before);
      EXPECT_LE(cut.messages.size(), messages);
      before = cut.messages.size();
      EXPECT_NE(cut.error.empty(), cut.warnings.empty()) << "reported once";
      EXPECT_LE(cut.warnings.size(), 1U);
    }
    EXPECT_EQ(before, messages) << "only the end is missing";
  }
}

TEST_F(SmallMcap, AnyDamagedByteIsHarmless) {
  for (const std::string& body : {records(), mcap_chunk(records()), mcap_chunk(records(), McapCompression::lz4),
                                  mcap_chunk(records(), McapCompression::zstd)}) {
    const std::string whole = closed(body);
    for (std::size_t at = 0; at < whole.size(); ++at) {
      for (const int value : {0, 0xFF, ~whole[at], whole[at] ^ 1}) {
        std::string damaged = whole;
        damaged[at] = static_cast<char>(value);
        SCOPED_TRACE(at);
        const Read borne = read(damaged);
        EXPECT_LE(borne.messages.size(), kAll.size());
        if (body.starts_with('\6')) { // chunks have a checksum: all messages or none
          EXPECT_TRUE(borne.messages.empty() || borne.messages.size() == kAll.size());
        }
      }
    }
  }
}

TEST_F(SmallMcap, ChunkWithAWrongChecksumIsDroppedAndReported) {
  const std::string good = mcap_chunk(declarations() + mcap_message(1, 1, "good"));
  const std::string bad = mcap_message(1, 2, "bad");
  const Read read_back = read(
      closed(good + mcap_chunk(bad, {bad.size(), crc_of(bad) + 1, ""}) + mcap_chunk(mcap_message(1, 3, "good again"))));
  EXPECT_EQ(read_back.messages, (std::vector<std::string>{"/imu 1 good", "/imu 3 good again"}));
  expect_warning(read_back, {"1 chunks or records", "byte " + std::to_string((head() + good).size()), "checksum"});
  EXPECT_EQ(read(closed(good + mcap_chunk(bad, {bad.size(), 0, ""}))).messages.size(), 2U) << "0: it has none";
}

TEST_F(SmallMcap, ChunkOfAnotherLengthThanDeclaredIsDropped) {
  const std::string good = mcap_chunk(declarations() + mcap_message(1, 1, "good"));
  const std::string bad = mcap_message(1, 2, std::string(1000, 'x'));
  for (const auto& [compression, name] :
       {std::pair{McapCompression::none, ""}, {McapCompression::lz4, "lz4"}, {McapCompression::zstd, "zstd"}}) {
    for (const std::uint64_t size : {bad.size() - 1, bad.size() + 1, std::size_t{0}, std::size_t{1}}) {
      const Read read_back = read(closed(good + mcap_chunk(packed(bad, compression), {size, 0, name})));
      EXPECT_EQ(read_back.messages, std::vector<std::string>{"/imu 1 good"}) << name << size;
      expect_warning(read_back, {"were skipped", "do not have their size"});
    }
    const std::string bytes = packed(bad, compression);
    for (const std::string& damaged :
         {bytes.substr(0, bytes.size() / 2), bytes.substr(1), std::string(), bytes + bytes}) {
      const Read read_back = read(closed(good + mcap_chunk(damaged, {bad.size(), crc_of(bad), name})));
      EXPECT_EQ(read_back.messages, std::vector<std::string>{"/imu 1 good"}) << name;
      EXPECT_EQ(read_back.warnings.size(), 1U);
    }
  }
}

/// Memory use stays below the limit for a chunk.
TEST_F(SmallMcap, AbsurdLengthsAreRejected) {
  const std::string good = mcap_chunk(declarations() + mcap_message(1, 1, "good"));
  for (const std::uint64_t size : {std::uint64_t{1} << 29U, std::uint64_t{1} << 62U, ~std::uint64_t{0}}) {
    for (const char* const compression : {"", "lz4", "zstd"}) {
      const Read read_back = read(closed(good + mcap_chunk("few", {size, 0, compression})));
      EXPECT_EQ(read_back.messages.size(), 1U);
      expect_warning(read_back, {"it claims " + std::to_string(size) + " bytes, more than 268435456"});
    }
    std::string length(reinterpret_cast<const char*>(&size), sizeof(size));
    for (const char op : {'\1', '\3', '\4', '\5', '\6', '\7', '\x7F'}) { // a record beyond the end of the file
      std::string cut = head() + good;
      cut.append(1, op).append(length).append("few");
      const Read read_back = read(cut);
      EXPECT_EQ(read_back.messages.size(), 1U);
      expect_warning(read_back, {"byte " + std::to_string((head() + good).size()), "ends in mid-record"});
    }
    const std::string inside = mcap_message(1, 2, "inside") + '\5' + length + "few";
    EXPECT_EQ(read(closed(good + mcap_chunk(inside))).messages.size(), 2U);
  }
}

TEST_F(SmallMcap, UnknownCompressionIsNamed) {
  expect_warning(read(closed(mcap_chunk(declarations()) + mcap_chunk("some", {4, 0, "brotli"}))),
                 {"cannot be read", "compressed by \"brotli\"; none, lz4 and zstd are read"});
  expect_warning(read(closed(mcap_chunk(declarations()) + mcap_chunk("some", {4, 0, "a\nb\x1B[31m\xFF"}))),
                 {"compressed by \"a?b?[31m?\""});
}

/// Tail of a file after a power failure.
TEST_F(SmallMcap, TrailingZerosAreATruncation) {
  const Read zeros = read(head() + records() + std::string(5000, '\0'));
  expect_all(zeros);
  expect_warning(zeros, {"byte " + std::to_string((head() + records()).size())});
}

TEST_F(SmallMcap, WithoutUsefulContentIsAnErrorOrEmpty) {
  EXPECT_TRUE(contains(read("").error, "the file is empty (0 bytes)"));
  EXPECT_TRUE(contains(read("\x89MCAP").error, "not an MCAP file"));
  EXPECT_TRUE(contains(read("\x89MCAP1\r\n and so on").error, "MCAP of another version than 0; record again"));
  EXPECT_TRUE(contains(read("hello, I am a text").error, "neither an SQLite database nor MCAP"));
  EXPECT_TRUE(contains(read(mcap_magic()).error, "was not closed by its recorder"));
  EXPECT_TRUE(
      contains(read(mcap_magic() + "garbage, and much more of it").error, "byte 8: the file ends in mid-record"));
  const Read none = read(closed(""));
  EXPECT_EQ(none.error, "");
  EXPECT_TRUE(none.topics.empty() && none.messages.empty() && none.warnings.empty());
}

TEST_F(SmallMcap, LastDeclarationOfAChannelCounts) {
  expect_all(read(closed(declarations() + records())));
  const std::string again = mcap_channel(1, 2, "/other");
  const Read read_back = read(closed(declarations() + mcap_message(1, 1, "a") + again + mcap_message(1, 2, "b")));
  EXPECT_EQ(read_back.messages.back(), "/other 2 b");
  EXPECT_EQ(read_back.messages.size(), 2U);
}

TEST_F(SmallMcap, MessageWithoutChannelOrWithAbsurdTimeIsDropped) {
  const Read unknown = read(closed(records() + mcap_message(7, 30, "whose?") + mcap_message(0, 30, "whose?")));
  expect_all(unknown);
  EXPECT_TRUE(unknown.warnings.empty());
  const Read late = read(closed(records() + mcap_message(1, ~std::uint64_t{0}, "late") +
                                mcap_message(1, 4'000'000'000'000'000'001, "late")));
  expect_all(late);
  expect_warning(late, {"2 messages with an absurd time"});
}

TEST_F(SmallMcap, UnsupportedEncodingsAreNamed) {
  const Read read_back =
      read(closed(mcap_schema(1, "foxglove.PointCloud", "protobuf") + mcap_channel(1, 1, "/points", "protobuf") +
                  mcap_channel(2, 0, "/text", "json") + mcap_schema(3, "sensor_msgs/Imu", "ros1msg") +
                  mcap_channel(3, 3, "/imu", "ros1")));
  EXPECT_EQ(read_back.topics, (std::vector<std::string>{"/points foxglove.PointCloud as protobuf",
                                                        "/text no schema as json", "/imu sensor_msgs/Imu"}));
}

/// A summary that is damaged or incomplete is ignored.
TEST_F(SmallMcap, IncompleteSummaryIsIgnored) {
  const std::string before = head() + records();
  for (const std::string& summary : {mcap_channel(1, 1, "/lie"), mcap_record(11, std::string(30, '\0')),
                                     std::string("garbage"), std::string(100, '\0')})
    expect_all(read(before + mcap_end(before, summary)));
}

/// Writers can be configured not to repeat the schemas, and may write them after the channels.
TEST_F(SmallMcap, SummaryWithoutSchemasOrWithThemLastGivesTheTypes) {
  const std::string before = head() + mcap_chunk(records());
  const std::string schemas = mcap_schema(1, "sensor_msgs/msg/Imu") + mcap_schema(2, "nav_msgs/msg/Odometry");
  const std::string channels = mcap_channel(1, 1, "/imu") + mcap_channel(2, 2, "/odom");
  for (std::string summary : {channels, channels + schemas, mcap_schema(1, "sensor_msgs/msg/Imu") + channels}) {
    summary += mcap_statistics(6, 2);
    const std::string end = mcap_end(before, summary);
    expect_all(read(std::string(before).append(end)));
  }
}

/// The test is a channel that only the summary contains.
TEST_F(SmallMcap, SummaryIsUsedOnlyWithACorrectChecksum) {
  const std::string before = head() + mcap_chunk(records());
  const std::string summary = declarations() + mcap_channel(3, 2, "/more") + mcap_statistics(6, 3);
  const std::string whole = before + mcap_end(before, summary);
  const Read believed = read(whole);
  EXPECT_EQ(believed.messages, kAll);
  EXPECT_EQ(believed.topics.back(), "/more nav_msgs/Odometry");
  constexpr std::size_t kCrc = 4;
  std::string wrong = whole;
  wrong[whole.size() - mcap_magic().size() - kCrc] ^= 1;
  expect_all(read(wrong));
  wrong.replace(whole.size() - mcap_magic().size() - kCrc, kCrc, kCrc, '\0');
  EXPECT_EQ(read(wrong).topics, believed.topics) << "0: it has none";
}

TEST_F(SmallMcap, TopicsBeyondTheLimitsAreDroppedAndReported) {
  const std::string long_name = "/" + std::string(4096, 'x');
  for (const std::string& more : {mcap_channel(3, 1, long_name), mcap_schema(3, long_name) + mcap_channel(3, 3, "/odd"),
                                  mcap_channel(3, 1, "/odd", long_name)}) {
    const Read bounded = read(closed(records() + more + mcap_message(3, 30, "odd")));
    expect_all(bounded);
    expect_warning(bounded, {"with a name or type of more than 4096 bytes, are skipped"});
  }
  std::string many;
  for (std::size_t i = 0; i < 70'000; ++i)
    many += mcap_channel(static_cast<std::uint16_t>(3 + i % 1000), 1, "/" + std::to_string(i));
  const Read bounded = read(closed(records() + many));
  EXPECT_EQ(bounded.messages, kAll);
  EXPECT_EQ(bounded.topics.size(), 65535U);
  expect_warning(bounded, {"topics beyond the 65535th"});
}

/// A bag split by rosbag2. The memory of a file is released when the next one is opened.
TEST(Mcap, FolderOfManyFilesUsesTheMemoryOfOne) {
  constexpr std::size_t kBytes = 32'000'000, kFiles = 8;
  const TemporaryFolder folder;
  const std::string chunk = mcap_chunk(mcap_schema(1, "sensor_msgs/msg/Imu") + mcap_channel(1, 1, "/imu") +
                                           mcap_message(1, 1, std::string(kBytes, 'x')),
                                       McapCompression::zstd);
  const std::string file = mcap_magic() + mcap_header() + chunk;
  for (std::size_t i = 0; i < kFiles; ++i)
    write_bytes(folder / ("drive_" + std::to_string(i) + ".mcap"), file + mcap_end(file));
  const auto in_use = [] {
    const struct mallinfo2 memory = mallinfo2();
    return memory.uordblks + memory.hblkhd;
  };
  const std::size_t before = in_use();
  const auto bag = tools::open_bag(folder.path());
  ASSERT_TRUE(bag) << bag.error();
  EXPECT_LT(in_use(), before + kBytes) << "opened";
  std::size_t messages = 0;
  for (; (*bag)->next() != nullptr; ++messages)
    EXPECT_LT(in_use(), before + 2 * kBytes) << messages;
  EXPECT_EQ(messages, kFiles);
  EXPECT_LT(in_use(), before + kBytes) << "read";
}

/// Files written by @mcap/core, the TypeScript library of the format's authors.
class McapOfMcapCore : public SmallMcap, public testing::WithParamInterface<const char*> {};

TEST_P(McapOfMcapCore, IsReadFieldByField) {
  const auto bag = tools::open_bag(std::filesystem::path(LOCUS_TEST_BAGS) / GetParam());
  ASSERT_TRUE(bag) << bag.error();
  int seen = 0;
  while (const tools::BagMessage* message = (*bag)->next()) {
    const tools::BagTopic& topic = (*bag)->topics().at(message->topic);
    EXPECT_EQ(topic.name, "/odom");
    EXPECT_EQ(topic.type, "nav_msgs/Odometry");
    const auto odometry = tools::read_odometry({message->data, topic.serialisation});
    ASSERT_TRUE(odometry);
    EXPECT_EQ(to_ns(message->recorded), 1'700'000'000'000'000'500 + 100'000'000LL * seen);
    EXPECT_EQ(odometry->header_.stamp_.sec_, 1'700'000'000);
    EXPECT_EQ(odometry->pose_.pose_.position_.x_, 1.5 + seen);
    EXPECT_EQ(odometry->pose_.pose_.orientation_.w_, 1.0);
    EXPECT_EQ(odometry->twist_.covariance_[35], 0.25);
    ++seen;
  }
  EXPECT_EQ(seen, 5);
  EXPECT_TRUE((*bag)->warnings().empty());
}
INSTANTIATE_TEST_SUITE_P(Samples, McapOfMcapCore, testing::Values("mcap_core_cdr.mcap", "mcap_core_ros1.mcap"));

} // namespace
} // namespace locus::test
