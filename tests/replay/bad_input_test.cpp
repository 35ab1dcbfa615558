// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <random>
#include <thread>

#include <gtest/gtest.h>
#include <pcap/pcap.h>
#include <unistd.h>

#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "replay_run.hpp"
#include "support/child.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// Expects one line on stderr with all these parts, and this exit status.
void expect_error(const ProgramRun& run, int status, const std::vector<std::string>& said) {
  EXPECT_EQ(run.status, status) << run.err;
  const std::vector<std::string> lines = lines_of(run.err);
  ASSERT_EQ(lines.size(), 1U) << run.err;
  for (const std::string& part : said)
    EXPECT_NE(lines[0].find(part), std::string::npos) << "no '" << part << "' in: " << lines[0];
}

/// A folder with one file of given bytes, and a run on it.
class BadCapture : public testing::Test {
 protected:
  ProgramRun replay(const std::string& content) {
    std::ofstream{folder_ / "bad.pcap", std::ios::binary} << content;
    return replay();
  }
  ProgramRun replay() { return run_program(LOCUS_REPLAY, {"-o", folder_ / "out", folder_ / "bad.pcap"}); }

  TemporaryFolder folder_;
};

TEST_F(BadCapture, DescriptionOfABagLeadsToItsFolder) {
  std::ofstream{folder_ / "metadata.yaml"} << "rosbag2_bagfile_information:\n";
  expect_error(run_program(LOCUS_REPLAY, {"-o", folder_ / "out", folder_ / "metadata.yaml"}), 1,
               {"metadata.yaml: describes a bag; name its folder instead: " + folder_.path().string()});
}

class OutputFolder : public testing::Test {
 protected:
  [[nodiscard]] ProgramRun replay(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"-o", out_, room_drive() / "lidar.pcap"});
    return run_program(LOCUS_REPLAY, arguments);
  }

  TemporaryFolder folder_;
  std::filesystem::path out_ = folder_ / "out";
};

TEST_F(OutputFolder, InputIsNotOverwritten) {
  ASSERT_EQ(replay({"--duration", "2"}).status, 0);
  const std::string poses = read_text(out_ / "odometry.tum");
  for (const std::vector<std::string>& input :
       {std::vector<std::string>{"--odometry", "wio=" + (out_ / "odometry.tum").string()},
        {"--ground-truth", out_ / "../out/odometry.tum"},
        {"--imu", out_ / "odometry.csv"},
        {"--map-truth", out_ / "map.pcd"}})
    expect_error(replay(input), 2, {"the run would write its own", "choose another folder with -o"});
  EXPECT_EQ(read_text(out_ / "odometry.tum"), poses);
}

TEST_F(OutputFolder, InterruptedRunLeavesNoResultsOfThePreviousOne) {
  ASSERT_EQ(replay({"--duration", "2"}).status, 0);
  Child second({LOCUS_REPLAY, "--realtime=0.01", "-o", out_, room_drive() / "lidar.pcap"});
  const auto is_left = [&](const char* name) { return std::filesystem::exists(out_ / name); };
  const std::array names{"summary.json", "report.html", "map.pcd"};
  const auto give_up = std::chrono::steady_clock::now() + patience();
  while (std::ranges::any_of(names, is_left) && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds{20});
  second.signal(SIGTERM);
  EXPECT_EQ(second.wait_for_exit(), 128 + SIGTERM);
  for (const char* const name : names)
    EXPECT_FALSE(is_left(name)) << name;
}

TEST_F(OutputFolder, PartWithoutAWholeSweepIsReportedWithAndWithoutTruth) {
  for (const std::vector<std::string>& truth :
       {std::vector<std::string>{}, {"--ground-truth", room_drive() / "gt.tum"}}) {
    std::vector<std::string> arguments{"--duration", "0.02"};
    arguments.insert(arguments.end(), truth.begin(), truth.end());
    expect_error(replay(arguments), 0, {"no whole sweep", "record for longer", "--duration"});
  }
}

TEST_F(OutputFolder, UnwritableStandardOutputIsAnError) {
  const ProgramRun run = run_program("/bin/sh", {"-c", std::string(LOCUS_REPLAY) + " -o " + out_.string() + " " +
                                                           (room_drive() / "lidar.pcap").string() + " > /dev/full"});
  expect_error(run, 1, {"standard output cannot be written"});
}

TEST_F(BadCapture, ZeroBytes) { expect_error(replay(""), 1, {"bad.pcap", "empty"}); }

TEST_F(BadCapture, PngNamedPcap) { expect_error(replay("\x89PNG\r\n\x1a\n rest of it"), 1, {"bad.pcap", "PNG"}); }

TEST_F(BadCapture, RandomBytes) {
  std::mt19937 random{7};
  std::string bytes(100'000, '\0');
  for (char& byte : bytes)
    byte = static_cast<char>(random());
  expect_error(replay(bytes), 1, {"bad.pcap", "not a pcap"});
}

TEST_F(BadCapture, ForeignLinkType) {
  { PcapWriter::open(folder_ / "bad.pcap", DLT_USB_LINUX); }
  expect_error(replay(), 1, {"bad.pcap", "link type"});
}

TEST_F(BadCapture, MissingFile) { expect_error(replay(), 1, {"bad.pcap", "no such file"}); }

TEST_F(BadCapture, NoDatagramsAtAll) {
  { PcapWriter::open(folder_ / "bad.pcap")->write_frame(stamp_from_ns(1), Bytes(60)); }
  expect_error(replay(), 1, {"bad.pcap", "no valid data packet", "no UDP datagram"});
}

TEST_F(BadCapture, DatagramsOfAnyLengthAreCountedAndRejected) {
  {
    PcapWriter pcap = std::move(*PcapWriter::open(folder_ / "bad.pcap"));
    for (std::size_t length = 0; length < 1500; ++length)
      pcap.write(stamp_from_ns(static_cast<std::int64_t>(1'700'000'000'000'000'000 + 1'000'000 * length)),
                 UdpAddresses{}, Bytes(length));
  }
  expect_error(replay(), 1, {"bad.pcap", "no valid data packet", "model 1"});
  const auto summary = nlohmann::json::parse(read_text(folder_ / "out/summary.json"));
  EXPECT_EQ(summary["packets"]["total"]["received"], 1500);
  EXPECT_EQ(summary["packets"]["total"]["rejected"]["length"], 1498);
  EXPECT_EQ(summary["packets"]["total"]["rejected"]["model"], 1);
  EXPECT_EQ(summary["packets"]["total"]["position"], 1);
}

TEST_F(BadCapture, TruncatedInMidPacketIsAWarning) {
  std::string bytes = read_text(room_drive() / "lidar.pcap");
  bytes.resize(bytes.size() / 2 + 17);
  const ProgramRun run = replay(bytes);
  EXPECT_EQ(run.status, 0);
  ASSERT_EQ(lines_of(run.err).size(), 1U) << run.err;
  EXPECT_NE(run.err.find("ends in mid-packet"), std::string::npos) << run.err;
  EXPECT_NEAR(static_cast<double>(read_tum(folder_ / "out/odometry.tum").size()), 40, 2);
}

/// Regression: the program played one packet and reported success.
TEST_F(BadCapture, UnsortedCaptureIsReportedWithTheProgramThatSortsIt) {
  constexpr std::size_t kPackets = 500;
  std::vector<std::pair<Stamp, Bytes>> packets;
  auto capture = Capture::open(room_drive() / "lidar.pcap");
  while (const Datagram* datagram = packets.size() < kPackets ? capture->next() : nullptr)
    packets.emplace_back(datagram->receive_stamp, Bytes(datagram->payload.begin(), datagram->payload.end()));
  std::ranges::reverse(packets);
  {
    PcapWriter pcap = std::move(*PcapWriter::open(folder_ / "bad.pcap"));
    for (const auto& [stamp, payload] : packets)
      pcap.write(stamp, UdpAddresses{}, payload);
  }
  std::size_t older = 0; // timestamps behind the predecessor's; a position packet arrives with a data packet
  for (std::size_t i = 1; i < packets.size(); ++i)
    older += packets[i].first < packets[i - 1].first ? 1U : 0U;
  const std::string counted = std::to_string(older) + " of its 500 datagrams";
  expect_error(replay(), 1, {"bad.pcap", counted, "runs backwards", "reordercap IN OUT"});
}

TEST_F(BadCapture, CompressedFilesThatAreDamagedOrUnsupportedAreReported) {
  const std::string rest = " and so on and so on and so on and so on";
  expect_error(replay("\x1F\x8B\x08" + rest), 1, {"bad.pcap: its gzip compression is damaged"});
  expect_error(replay("\xFD"
                      "7zXZ" +
                      rest),
               1, {"bad.pcap: its xz compression is damaged"});
  expect_error(replay("\x28\xB5\x2F\xFD" + rest), 1, {"bad.pcap: its zstd compression is damaged"});
  expect_error(replay("BZh91AY&SY" + rest), 1, {"a bzip2-compressed file", "bzip2 -dc <", "/bad.pcap.unpacked"});
}

TEST_F(BadCapture, UnsupportedLidarIsNamedWithItsMaker) {
  const auto write = [&](std::uint16_t port, std::size_t bytes, int first, int second, int third = 4, int fourth = 3) {
    PcapWriter pcap = std::move(*PcapWriter::open(folder_ / "bad.pcap"));
    Bytes payload(bytes);
    payload[0] = std::byte(first);
    payload[1] = std::byte(second);
    payload[2] = std::byte(third);
    payload[3] = std::byte(fourth);
    for (int i = 0; i < 20; ++i)
      pcap.write(stamp_from_ns(1'700'000'000'000'000'000 + 1'000'000LL * i), UdpAddresses{.destination_port = port},
                 payload);
  };
  write(2368, 1080, 0xEE, 0xFF);
  expect_error(
      replay(), 1,
      {"bad.pcap", "20 packets look like those of a Hesai AT128", "port 2368", "1080 bytes", "which are not read"});
  write(6699, 1248, 0x55, 0xAA, 0x05, 0x5A);
  expect_error(replay(), 1,
               {"bad.pcap", "20 packets look like those of a RoboSense (most go to port 6699", "not read"});
  write(7503, 48, 0, 0);
  expect_error(replay(), 1, {"bad.pcap", "20 packets of the inertial unit of an Ouster", "port 7503", "mostly 7502"});
  write(7502, 6464, 1, 0);
  expect_error(replay(), 1, {"bad.pcap", "20 packets look like those of a lidar of Ouster", "port 7502", "6464 bytes"});
}

/// A pipe can be read only once, but a bag is read twice.
TEST(WrongUsage, PipeWithoutACapture) {
  const auto from = [](const std::string& program) {
    const TemporaryFolder folder;
    return run_program("/bin/sh", {"-c", program + " | " + LOCUS_REPLAY + " -o " + (folder / "out").string() + " -"});
  };
  expect_error(from("true"), 1, {"-: the file is empty (0 bytes)"});
  expect_error(from("yes"), 1, {"-: a text file, not a pcap or pcapng capture"});
  expect_error(from("printf '#ROSBAG V2.0'"), 1, {"-: a ROS 1 bag, not a pcap or pcapng capture"});
}

TEST(WrongUsage, FolderAboveAKittiDriveResolvesToItsOnlyDrive) {
  const std::filesystem::path day = kitti_room_drive().parent_path();
  const Replay replay({"--duration", "1", day.string()});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_NE(replay.run().out.find(day.string() + ": the only recording in it is used, " + kitti_room_drive().string()),
            std::string::npos)
      << replay.run().out;
  const TemporaryFolder empty;
  expect_error(Replay({empty.path().string()}).run(), 1, {"holds no lidar.pcap"});
}

/// A folder that contains the day's folder and other recordings.
TEST(WrongUsage, FolderOfManyRecordingsListsSome) {
  expect_error(Replay({kitti_room_drive().parent_path().parent_path().string()}).run(), 1,
               {"name one of them: ", kitti_room_drive(), "more"});
}

/// Stale output files would be mistaken for results.
TEST(WrongUsage, OtherPortIsNamedWithTheOverrideAndOnlyTheSummaryIsWritten) {
  const TemporaryFolder folder;
  const std::string capture = room_drive().string(), out = folder / "out";
  EXPECT_EQ(run_program(LOCUS_REPLAY, {"--duration", "1", "-o", out, capture}).status, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "out/report.html"));
  expect_error(run_program(LOCUS_REPLAY, {"--set", "lidars.front.port=3000", "-o", out, capture}), 1,
               {"packets to port 2368, configured 3000", "--set lidars.0.port=2368"});
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(out))
    left.push_back(entry.path().filename());
  EXPECT_EQ(left, std::vector<std::string>{"summary.json"});
}

TEST(WrongUsage, ResultsAreNotWrittenIntoARecording) {
  const std::string capture = room_drive().string();
  expect_error(run_program(LOCUS_REPLAY, {"-o", capture, capture}), 2, {"-o " + capture, "contains a recording"});
  expect_error(run_program(LOCUS_REPLAY, {"-o", capture + "/.", capture + "/lidar.pcap"}), 2, {"contains a recording"});
  EXPECT_FALSE(std::filesystem::exists(room_drive() / "odometry.tum"));
}

TEST(WrongUsage, OtherAddressIsNamedWithTheOverride) {
  const Replay replay({"--set", "lidars.front.source_ip=10.0.0.1", room_drive().string()});
  expect_error(replay.run(), 1, {"come from 192.168.1.201", "--set lidars.0.source_ip=192.168.1.201"});
}

TEST(WrongUsage, PartBeyondTheCapture) {
  expect_error(Replay({"--start", "100", room_drive().string()}).run(), 1, {"--start"});
}

TEST(WrongUsage, UnknownOptionIsNamedWithTheNearestOne) {
  expect_error(Replay({"--frobnicate", "x.pcap"}).run(), 2, {"no option --frobnicate"});
  expect_error(Replay({"--thread", "2", "x.pcap"}).run(), 2, {"no option --thread; the nearest is --threads"});
  expect_error(Replay({"--ground-truht=gt.tum", "x.pcap"}).run(), 2, {"--ground-truht; the nearest is --ground-truth"});
  expect_error(run_program(LOCUS_REPLAY, {"--outptu", "x", "x.pcap"}), 2, {"--outptu; the nearest is --output"});
}

TEST(WrongUsage, NoCapture) { expect_error(Replay(std::vector<std::string>{}).run(), 2, {"CAPTURE"}); }

TEST(WrongUsage, NoOutput) { expect_error(run_program(LOCUS_REPLAY, {"x.pcap"}), 2, {"--output"}); }

TEST(WrongUsage, UnknownKeyIsNamedWithFileAndLine) {
  const TemporaryFolder folder;
  std::ofstream{folder / "robot.yaml"} << "# mine\nvoxel_filtre: {enabled: true}\n";
  expect_error(Replay({"-c", folder / "robot.yaml", room_drive().string()}).run(), 2,
               {"robot.yaml:2", "voxel_filtre", "voxel_filter"});
}

TEST(WrongUsage, MissingConfiguration) {
  expect_error(Replay({"-c", "/nowhere.yaml", room_drive().string()}).run(), 2, {"/nowhere.yaml"});
}

TEST(WrongUsage, BadOverrides) {
  const std::string capture = room_drive().string();
  expect_error(Replay({"--set", "voxel_filter.leaf=1", capture}).run(), 2, {"--set voxel_filter.leaf=1", "leaf_m"});
  expect_error(Replay({"--set", "voxel_filter.leaf_m=-1", capture}).run(), 2, {"voxel_filter.leaf_m"});
  expect_error(Replay({"--set", "nonsense", capture}).run(), 2, {"--set nonsense"});
  expect_error(Replay({"--threads", "0", capture}).run(), 2, {"--threads"});
  expect_error(Replay({"--start", "nan", capture}).run(), 2, {"--start"});
  expect_error(Replay({"--realtime=0", capture}).run(), 2, {"--realtime"});
}

TEST(WrongUsage, BadFaults) {
  const std::string capture = room_drive().string();
  expect_error(Replay({"--fail", "front", capture}).run(), 2, {"fault", "front:lost@10-20"});
  expect_error(Replay({"--fail", "front:melted@1", capture}).run(), 2, {"melted", "packet-loss"});
  expect_error(Replay({"--fail", "rear:lost@1", capture}).run(), 2, {"rear", "front"});
  expect_error(Replay({"--fail", "front:covariance@1", capture}).run(), 2, {"covariance"});
}

TEST(WrongUsage, OdometryFilesMustBeNamedAsASource) {
  const std::string capture = room_drive().string();
  expect_error(Replay({"--odometry", "wheels.tum", capture}).run(), 2, {"NAME=FILE"});
  expect_error(Replay({"--odometry", "legs=wheels.tum", capture}).run(), 2, {"legs", "motion_sources"});
  expect_error(Replay({"--odometry", "wio=/nowhere.tum", capture}).run(), 1, {"/nowhere.tum"});
}

TEST(WrongUsage, UnmatchedFilesAndSourcesAreWarnings) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder.path());
  std::filesystem::rename(folder / "wio.tum", folder / "legs.tum");
  const Replay replay({folder.path().string()});
  EXPECT_EQ(replay.run().status, 0);
  const std::vector<std::string> lines = lines_of(replay.run().err);
  ASSERT_EQ(lines.size(), 2U) << replay.run().err;
  EXPECT_NE(lines[0].find("{name: legs, kind: odometry}"), std::string::npos) << lines[0];
  EXPECT_NE(lines[1].find("--odometry wio=FILE"), std::string::npos) << lines[1];
}

TEST(WrongUsage, UnwritableOutput) {
  const TemporaryFolder folder;
  std::ofstream{folder / "file"} << "not a folder";
  const std::string capture = room_drive().string();
  expect_error(run_program(LOCUS_REPLAY, {"-o", folder / "file", capture}), 1, {folder / "file"});
  expect_error(run_program(LOCUS_REPLAY, {"-o", (folder / "file/below").string(), capture}), 1, {"file/below"});
}

TEST(WrongUsage, FullDiskIsAnError) {
  const TemporaryFolder folder;
  ASSERT_EQ(::symlink("/dev/full", (folder / "odometry.csv").c_str()), 0);
  expect_error(run_program(LOCUS_REPLAY, {"-o", folder.path().string(), room_drive().string()}), 1,
               {"odometry.csv", "space"});
}

} // namespace
} // namespace locus::test
