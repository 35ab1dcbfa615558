// SPDX-License-Identifier: Apache-2.0
// Replay of captures and bags that are compressed, split, or on standard input.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include <gtest/gtest.h>
#include <lzma.h>
#include <sys/resource.h>
#include <zlib.h>
#include <zstd.h>

#include "bag_writer.hpp"
#include "bags/bag.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/errors.hpp"
#include "support/test_drives.hpp"
#include "unpacking/unpacked_copy.hpp"
#include "unpacking/unpacking_stream.hpp"

namespace locus::test {
namespace {

void put(const std::filesystem::path& file, const std::string& content) {
  std::ofstream{file, std::ios::binary} << content;
}

std::string gzip(const std::string& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 1, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  std::string in = bytes;
  stream.next_in = reinterpret_cast<Bytef*>(in.data());
  stream.avail_in = static_cast<uInt>(in.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string xz(const std::string& bytes) {
  std::string out(lzma_stream_buffer_bound(bytes.size()), '\0');
  std::size_t size = 0;
  EXPECT_EQ(lzma_easy_buffer_encode(0, LZMA_CHECK_CRC64, nullptr, reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                    bytes.size(), reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size()),
            LZMA_OK);
  out.resize(size);
  return out;
}

std::string zstd(const std::string& bytes) { return packed(bytes, McapCompression::zstd); }

struct Packing {
  const char* name; ///< file name
  std::string (*pack)(const std::string&);
};

class Packed : public testing::TestWithParam<Packing> {
 protected:
  struct Unpacked {
    std::string bytes;
    std::string problem;
  };
  /// Decompresses in steps of this many bytes.
  Unpacked unpack(const std::string& bytes, std::size_t step = 1000) {
    put(folder_ / "packed", bytes);
    const auto stream = tools::unpacked(std::move(*open_stream(folder_ / "packed")));
    Unpacked result;
    std::vector<std::byte> buffer(step);
    while (const std::size_t count = stream->read(buffer)) {
      result.bytes.append(reinterpret_cast<const char*>(buffer.data()), count);
      EXPECT_LE(stream->progress(), 1.0);
    }
    result.problem = stream->problem();
    return result;
  }
  [[nodiscard]] static std::string pack(const std::string& bytes) { return GetParam().pack(bytes); }

  TemporaryFolder folder_;
};

std::string some_bytes(std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; bytes.size() < size; ++i)
    bytes += std::to_string(i * i % 977) + ",";
  return bytes.substr(0, size);
}

TEST_P(Packed, DecompressionRestoresTheBytes) {
  for (const std::size_t size : {0U, 1U, 1000U, 65536U, 1000000U}) {
    for (const std::size_t step : {1000U, 70000U}) {
      const Unpacked result = unpack(pack(some_bytes(size)), step);
      EXPECT_TRUE(result.bytes == some_bytes(size)) << size;
      EXPECT_EQ(result.problem, "");
    }
  }
}

/// Concatenated files, as appended by rotating recorders.
TEST_P(Packed, ConcatenatedFilesAreReadInOrder) {
  const Unpacked result = unpack(pack("first, ") + pack("") + pack(some_bytes(200'000)));
  EXPECT_TRUE(result.bytes == "first, " + some_bytes(200'000));
  EXPECT_EQ(result.problem, "");
}

TEST_P(Packed, FileCutAtAnyByteIsReadUpToTheCutAndReported) {
  const std::string whole = pack(some_bytes(300));
  for (std::size_t size = 6; size < whole.size(); ++size) {
    const Unpacked cut = unpack(whole.substr(0, size));
    EXPECT_TRUE(some_bytes(300).starts_with(cut.bytes)) << size;
    EXPECT_TRUE(contains(cut.problem, "compression is truncated")) << size << cut.problem;
  }
}

TEST_P(Packed, AnyDamagedByteIsHarmless) {
  const std::string whole = pack(some_bytes(300));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(~damaged[at]);
    EXPECT_LE(unpack(damaged).bytes.size(), 100'000U) << at;
  }
}

TEST_P(Packed, CaptureGivesTheSameBits) {
  const TemporaryFolder folder;
  const std::string capture = read_text(room_drive() / "lidar.pcap");
  const std::string name = folder / (std::string("drive.pcap.") + GetParam().name);
  put(name, pack(capture));
  const Replay plain({room_drive() / "lidar.pcap"}), of_packed({name});
  EXPECT_EQ(of_packed.run().status, 0);
  EXPECT_EQ(of_packed.run().err, "");
  EXPECT_TRUE(read_text(of_packed.file("odometry.csv")) == read_text(plain.file("odometry.csv")));

  put(name, pack(capture).substr(0, pack(capture).size() / 2));
  const Replay cut({name});
  EXPECT_EQ(cut.run().status, 0);
  EXPECT_EQ(lines_of(cut.run().err).size(), 1U) << cut.run().err;
  EXPECT_TRUE(contains(cut.run().err, "is truncated")) << cut.run().err;

  put(name, pack("hello, I am a text"));
  EXPECT_TRUE(contains(Replay({name}).run().err, "a text file, not a pcap or pcapng capture"));
}

TEST_P(Packed, StandardInputMayBeACapture) {
  const TemporaryFolder folder;
  put(folder / "packed", pack(read_text(room_drive() / "lidar.pcap")));
  const std::string out = folder / "out";
  const ProgramRun run = run_program(
      "/bin/sh", {"-c", "cat " + (folder / "packed").string() + " | " + LOCUS_REPLAY + " -o " + out + " -"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.err, "");
  EXPECT_TRUE(read_text(out + "/odometry.csv") ==
              read_text(Replay({room_drive() / "lidar.pcap"}).file("odometry.csv")));
}

INSTANTIATE_TEST_SUITE_P(Packings, Packed,
                         testing::Values(Packing{"gz", gzip}, Packing{"xz", xz}, Packing{"zst", zstd}),
                         [](const auto& instance) { return std::string(instance.param.name); });

TEST(Unpacked, UncompressedDataIsUnchanged) {
  const TemporaryFolder folder;
  for (const std::string& bytes : {std::string(), std::string("x"), some_bytes(200'000)}) {
    put(folder / "plain", bytes);
    const auto stream = tools::unpacked(std::move(*open_stream(folder / "plain")));
    std::string read_back;
    std::vector<std::byte> buffer(777);
    while (const std::size_t count = stream->read(buffer))
      read_back.append(reinterpret_cast<const char*>(buffer.data()), count);
    EXPECT_TRUE(read_back == bytes);
    EXPECT_EQ(stream->problem(), "");
  }
}

/// A read error is more informative than the resulting truncation.
TEST(Unpacked, ReadErrorIsNotReportedAsDamage) {
  class Failing : public ByteStream {
   public:
    explicit Failing(std::string bytes) : bytes_(std::move(bytes)) {}
    std::size_t read(std::span<std::byte> out) override {
      const std::size_t count = std::min(out.size(), bytes_.size() - at_);
      std::memcpy(out.data(), bytes_.data() + at_, count);
      at_ += count;
      return count;
    }
    [[nodiscard]] std::string problem() const override {
      return at_ < bytes_.size() ? "" : "cannot be read to its end (Input/output error)";
    }
    [[nodiscard]] double progress() const override { return 0; }

   private:
    std::string bytes_;
    std::size_t at_ = 0;
  };
  for (const auto& pack : {gzip, xz, zstd}) {
    const std::string whole = pack(some_bytes(100'000));
    const auto stream = tools::unpacked(std::make_unique<Failing>(whole.substr(0, whole.size() / 2)));
    std::vector<std::byte> buffer(1000);
    while (stream->read(buffer) > 0) {
    }
    EXPECT_EQ(stream->problem(), "cannot be read to its end (Input/output error)");
  }
}

long most_memory_of_children_kB() {
  rusage children{};
  EXPECT_EQ(getrusage(RUSAGE_CHILDREN, &children), 0);
  return children.ru_maxrss; // NOLINT(cppcoreguidelines-pro-type-union-access): the C library's
}

/// Decompression bomb: 500 MB of zeros in 500 kB, a capture of empty frames, is streamed and not stored.
TEST(Unpacked, DecompressionBombUsesLittleMemory) {
  const TemporaryFolder folder;
  const std::string zeros = gzip(std::string(5'000'000, '\0'));
  std::string bomb = gzip(read_text(room_drive() / "lidar.pcap").substr(0, 24)); // file header
  for (int i = 0; i < 100; ++i)
    bomb += zeros;
  put(folder / "bomb.pcap.gz", bomb);
  const long before_kB = most_memory_of_children_kB();
  const ProgramRun run = run_program(
      LOCUS_REPLAY, {"--threads", "1", "-o", (folder / "out").string(), (folder / "bomb.pcap.gz").string()});
  EXPECT_EQ(run.status, 1);
  EXPECT_LE(most_memory_of_children_kB(), std::max(before_kB, 400'000L));
  EXPECT_TRUE(contains(run.err, "no UDP datagram in 31250000 frames")) << run.err;
}

/// Parts from tcpdump -C, all but the last compressed by its -z.
TEST(Parts, OfACaptureAreReadInOrder) {
  const TemporaryFolder folder;
  const std::string capture = read_text(room_drive() / "lidar.pcap");
  constexpr std::size_t kHeader = 24, kParts = 12;
  std::vector<std::size_t> ends{kHeader};
  for (std::size_t at = kHeader; at < capture.size();) {
    std::uint32_t length = 0;
    std::memcpy(&length, capture.data() + at + 8, sizeof(length));
    at += 16 + length;
    if (at >= capture.size() * ends.size() / kParts)
      ends.push_back(at);
  }
  ASSERT_EQ(ends.size(), kParts + 1);
  for (std::size_t i = 0; i < kParts; ++i) {
    const std::string part = capture.substr(0, kHeader) + capture.substr(ends[i], ends[i + 1] - ends[i]);
    const std::string name = "drive.pcap" + (i > 0 ? std::to_string(i) : "");
    put(folder / (i + 1 < kParts ? name + ".gz" : name), i + 1 < kParts ? gzip(part) : part);
  }
  const Replay whole({room_drive() / "lidar.pcap"}), parts({folder / "drive.pcap.gz"}),
      one({folder / "drive.pcap3.gz"});
  EXPECT_EQ(parts.run().err, "");
  EXPECT_TRUE(contains(parts.run().out, "drive.pcap.gz: with the parts that follow it, up to drive.pcap11"))
      << parts.run().out;
  EXPECT_TRUE(read_text(parts.file("odometry.csv")) == read_text(whole.file("odometry.csv")));
  EXPECT_LT(one.trajectory().size(), parts.trajectory().size() / 6) << "a named part is replayed alone";
}

/// tcpdump -C with -W, or with a name without .pcap, names the parts like other files.
TEST(Parts, AmbiguousPartsAreNamed) {
  const TemporaryFolder folder;
  for (const char* const name : {"ring.pcap00", "ring.pcap01", "drive", "drive1", "lidar0", "lidar2"})
    std::filesystem::copy(room_drive() / "lidar.pcap", folder / name);
  for (const auto& [first, next] : {std::pair{"ring.pcap00", "ring.pcap01"}, {"drive", "drive1"}}) {
    const Replay replay({"--duration", "1", folder / first});
    EXPECT_EQ(replay.run().status, 0);
    EXPECT_TRUE(contains(replay.run().err, std::string{first} + ": is replayed alone, without " + next))
        << replay.run().err;
    EXPECT_TRUE(contains(replay.run().err, "mergecap -w")) << replay.run().err;
  }
  for (const char* const alone : {"ring.pcap01", "lidar0"})
    EXPECT_EQ(Replay({"--duration", "1", folder / alone}).run().err, "") << alone;
}

TEST(FolderAbove, ResolvesToItsOnlyRecording) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "day");
  std::filesystem::copy(room_drive() / "lidar.pcap", folder / "day/drive.pcap");
  const Replay replay({"--duration", "1", folder.path()});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().out, "the only recording in it is used, ")) << replay.run().out;
  put(folder / "day/other.bag", ros1_bag(messages_of(room_drive(), RosVersion::ros1)));
  const Replay of_two({folder.path()});
  EXPECT_EQ(of_two.run().status, 1);
  EXPECT_TRUE(contains(of_two.run().err, "contains 2 recordings")) << of_two.run().err;
}

/// Contains messages_of() the room drive.
class PackedBag : public testing::Test {
 protected:
  PackedBag() {
    write_db3(folder_ / "whole.db3", messages_);
    odometry_ = odometry_of(folder_ / "whole.db3");
    std::filesystem::create_directories(folder_ / "drive");
  }

  static std::string odometry_of(const std::string& recording) {
    const Replay replay({"-c", room_drive() / "config.yaml", recording});
    EXPECT_EQ(replay.run().status, 0) << replay.run().err;
    EXPECT_EQ(replay.run().err, "");
    return read_text(replay.file("odometry.csv"));
  }
  void write_metadata(const std::string& storage, const std::string& mode, const std::string& file) {
    put(folder_ / "drive/metadata.yaml", "rosbag2_bagfile_information:\n  storage_identifier: " + storage +
                                             "\n  relative_file_paths: [" + file + "]\n  compression_format: zstd\n" +
                                             "  compression_mode: " + mode + "\n");
  }

  TemporaryFolder folder_;
  const std::vector<RecordedMessage> messages_ = messages_of(room_drive(), RosVersion::ros2);
  std::string odometry_;
};

TEST_F(PackedBag, FileByFileGivesTheSameBits) {
  put(folder_ / "drive/drive_0.db3.zstd", zstd(read_text(folder_ / "whole.db3")));
  EXPECT_TRUE(odometry_of(folder_ / "drive/drive_0.db3.zstd") == odometry_);
  EXPECT_TRUE(odometry_of(folder_ / "drive") == odometry_) << "without metadata";
  write_metadata("sqlite3", "FILE", "drive_0.db3.zstd");
  EXPECT_TRUE(odometry_of(folder_ / "drive") == odometry_);

  put(folder_ / "drive/drive_0.mcap.zstd", zstd(mcap_file(messages_, RosVersion::ros2)));
  write_metadata("mcap", "FILE", "drive_0.mcap.zstd");
  EXPECT_TRUE(odometry_of(folder_ / "drive") == odometry_);
}

TEST_F(PackedBag, MessageByMessageGivesTheSameBits) {
  std::vector<RecordedMessage> compressed = messages_;
  for (RecordedMessage& message : compressed) {
    const std::string bytes = zstd({reinterpret_cast<const char*>(message.data.data()), message.data.size()});
    const auto data = std::as_bytes(std::span{bytes});
    message.data.assign(data.begin(), data.end());
  }
  write_db3(folder_ / "drive/drive_0.db3", compressed);
  write_metadata("sqlite3", "MESSAGE", "drive_0.db3");
  EXPECT_TRUE(odometry_of(folder_ / "drive") == odometry_);
  put(folder_ / "packed.mcap", mcap_file(compressed, RosVersion::ros2));
  EXPECT_TRUE(odometry_of(folder_ / "packed.mcap") == odometry_);

  for (std::size_t i = 0; i < 30; ++i) // truncated to a half, a third or a quarter
    compressed[i].data.resize(compressed[i].data.size() / (i % 3 + 2));
  write_db3(folder_ / "damaged.db3", compressed);
  const Replay damaged({"-c", room_drive() / "config.yaml", folder_ / "damaged.db3"});
  EXPECT_EQ(damaged.run().status, 0);
  EXPECT_TRUE(contains(damaged.run().err, "30 messages are compressed with zstd and damaged")) << damaged.run().err;
}

TEST_F(PackedBag, TruncatedBagIsReadUpToTheCut) {
  const std::string whole = zstd(mcap_file(messages_, RosVersion::ros2));
  put(folder_ / "cut.mcap.zstd", whole.substr(0, whole.size() / 2));
  const Replay cut({"-c", room_drive() / "config.yaml", folder_ / "cut.mcap.zstd"});
  EXPECT_EQ(cut.run().status, 0);
  EXPECT_TRUE(contains(cut.run().err, "cut.mcap.zstd: its zstd compression is truncated; what precedes it is used"))
      << cut.run().err;
  EXPECT_GT(cut.trajectory().size(), 20U);
}

/// Decompression stops early if the content is no bag, or if the disk would fill up.
TEST(UnpackedCopy, StopsIfTheContentIsUselessOrTheDiskNearlyFull) {
  const TemporaryFolder folder;
  put(folder / "zeros.zst", zstd(std::string(8'000'000, '\0')));
  const auto begins_with_x = [](std::string_view start) { return start.starts_with("x"); };
  const auto beginning = tools::UnpackedCopy::make(folder / "zeros.zst", begins_with_x);
  ASSERT_TRUE(beginning) << beginning.error();
  EXPECT_LE(std::filesystem::file_size(beginning->path()), 1'000'000U);
  put(folder / "x.zst", zstd("x" + std::string(1'000'000, '\0')));
  constexpr std::uint64_t kMoreThanThereIs = std::uint64_t{1} << 62U;
  const auto full = tools::UnpackedCopy::make(folder / "x.zst", begins_with_x, kMoreThanThereIs);
  ASSERT_FALSE(full);
  EXPECT_TRUE(contains(full.error(), "would leave less than")) << full.error();
  EXPECT_TRUE(contains(full.error(), "export TMPDIR=FOLDER")) << full.error();
  const auto whole = tools::UnpackedCopy::make(folder / "x.zst", begins_with_x);
  ASSERT_TRUE(whole) << whole.error();
  EXPECT_EQ(std::filesystem::file_size(whole->path()), 1'000'001U);
}

/// The temporary file is unlinked while the program runs, so that nothing remains.
TEST_F(PackedBag, LeavesNoTemporaryFile) {
  const TemporaryFolder temporary;
  put(folder_ / "drive.db3.zst", zstd(read_text(folder_ / "whole.db3")));
  const auto replay_with = [&](const std::string& folder) {
    return run_program("/bin/sh", {"-c", "TMPDIR=" + folder + " " + LOCUS_REPLAY + " -c " +
                                             (room_drive() / "config.yaml").string() + " -o " +
                                             (folder_ / "out").string() + " " + (folder_ / "drive.db3.zst").string()});
  };
  const ProgramRun good = replay_with(temporary.path());
  EXPECT_EQ(good.status, 0) << good.err;
  EXPECT_TRUE(read_text(folder_ / "out/odometry.csv") == odometry_);
  EXPECT_TRUE(std::filesystem::is_empty(temporary.path()));
  const ProgramRun bad = replay_with("/nowhere/at/all");
  EXPECT_EQ(bad.status, 1);
  EXPECT_EQ(lines_of(bad.err).size(), 1U) << bad.err;
  EXPECT_TRUE(contains(bad.err, "drive.db3.zst: it is compressed, and cannot be unpacked in /nowhere/at/all"))
      << bad.err;
  std::filesystem::path path;
  {
    auto copy = tools::UnpackedCopy::make(folder_ / "drive.db3.zst", [](std::string_view) { return true; });
    ASSERT_TRUE(copy) << copy.error();
    EXPECT_TRUE(read_text(copy->path()) == read_text(folder_ / "whole.db3"));
    path = *copy->give_name();
    EXPECT_TRUE(read_text(path) == read_text(folder_ / "whole.db3"));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(PackedBag, UnsupportedCompressionIsNamed) {
  write_metadata("sqlite3", "FILE", "drive_0.db3.lz4");
  std::string metadata = read_text(folder_ / "drive/metadata.yaml");
  put(folder_ / "drive/metadata.yaml", metadata.replace(metadata.find("zstd"), 4, "lz4"));
  const ProgramRun run = run_program(LOCUS_REPLAY, {"-o", folder_ / "out", folder_ / "drive"});
  EXPECT_EQ(run.status, 1);
  EXPECT_TRUE(contains(run.err, "compressed with lz4, which is not read; convert it to zstd")) << run.err;
}

} // namespace
} // namespace locus::test
