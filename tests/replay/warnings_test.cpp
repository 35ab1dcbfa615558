// SPDX-License-Identifier: Apache-2.0
// Warnings about likely mistakes that used to pass silently.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <functional>
#include <string_view>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// Expects success, and one warning with all these parts.
void expect_warning(const std::vector<std::string>& arguments, const std::vector<std::string>& said) {
  const Replay replay(arguments);
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<std::string> lines = lines_of(replay.run().err);
  ASSERT_EQ(lines.size(), 1U) << replay.run().err;
  EXPECT_TRUE(lines[0].starts_with("locus-replay: warning: ")) << lines[0];
  for (const std::string& part : said)
    EXPECT_NE(lines[0].find(part), std::string::npos) << "no '" << part << "' in: " << lines[0];
}

TEST(Warnings, AreAbsentInAGoodRun) {
  EXPECT_EQ(Replay({"--set", "lidars.front.model=VLP-16", room_drive().string()}).run().err, "");
}

/// Decoded as a VLP-32C's, the packets of a VLP-16 yield a smooth trajectory through a wrong scene.
TEST(Warnings, PacketsOfAnotherModelThanTheConfiguredOne) {
  expect_warning({"--set", "lidars.front.model=VLP-32C", "--duration", "2", room_drive().string()},
                 {"lidar front: configured as VLP-32C", "those of a VLP-16", "--set lidars.front.model=auto"});
}

/// A source of which every sample was refused was refused in silence.
TEST(Warnings, SourceWhoseSamplesAreAllRejected) {
  const TemporaryFolder folder;
  std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  for (RecordedMessage& message : messages)
    if (message.topic == "/wheel_odometry")
      message.data = odometry_message({.stamp = message.recorded,
                                       .arrival = message.recorded,
                                       .T_source_base = {Eigen::Quaterniond{0, 0, 0, 0}, Eigen::Vector3d::Zero()}},
                                      RosVersion::ros2);
  write_db3(folder / "drive.db3", messages);
  const Replay replay({"-c", room_drive() / "config.yaml", (folder / "drive.db3").string()});
  EXPECT_NE(replay.run().err.find("warning: motion source wio was rejected for"), std::string::npos)
      << replay.run().err;
  EXPECT_NE(replay.run().err.find("orientations that are no rotation"), std::string::npos) << replay.run().err;
  const std::string verdict = replay.summary()["sources"]["wio"]["verdict"];
  EXPECT_NE(verdict.find("orientations that are no rotation"), std::string::npos) << verdict;
  EXPECT_EQ(replay.summary()["sources"]["wio"]["used_sweeps"], 0);
}

/// An IMU whose driver passes its samples on in bursts was left out in silence.
TEST(Warnings, SourceWhoseSamplesArriveInBursts) {
  const TemporaryFolder folder;
  std::filesystem::copy_file(room_drive() / "imu.csv", folder / "imu.csv");
  std::ofstream arrivals(folder / "imu.meta.csv");
  arrivals << "t_ns,arrival_ns,covariance_scale\n";
  const std::vector<ImuSample> samples = MotionSamples<ImuSample>::open(room_drive() / "imu.csv")->drain();
  for (std::size_t i = 0; i < samples.size(); ++i)
    arrivals << to_ns(samples[i].stamp) << ',' << to_ns(samples[std::min(i / 12 * 12 + 11, samples.size() - 1)].stamp)
             << ",1\n";
  arrivals.close();
  expect_warning({"--imu", folder / "imu.csv", room_drive().string()},
                 {"motion source imu was rejected for", "its samples arrive in bursts"});
}

/// A lidar whose laser is off sends its position packets alone; the advice was to record what had been recorded.
/// Applies `change` to each packet of a capture.
void rewrite(const std::filesystem::path& from, const std::filesystem::path& to,
             const std::function<void(UdpAddresses&, Bytes&)>& change) {
  auto capture = Capture::open(from);
  auto writer = PcapWriter::open(to);
  while (const Datagram* datagram = capture->next()) {
    UdpAddresses addresses{.source_ip = datagram->source_ip, .destination_port = datagram->destination_port};
    Bytes payload(datagram->payload.begin(), datagram->payload.end());
    change(addresses, payload);
    writer->write(datagram->receive_stamp, addresses, payload);
  }
}

TEST(Warnings, LidarThatSendsOnlyPositionPackets) {
  const TemporaryFolder folder;
  auto capture = Capture::open(room_drive() / "lidar.pcap");
  {
    auto writer = PcapWriter::open(folder / "positions.pcap");
    while (const Datagram* datagram = capture->next())
      if (datagram->payload.size() == velodyne::kPositionPacketBytes)
        writer->write(datagram->receive_stamp,
                      {.source_ip = datagram->source_ip, .destination_port = datagram->destination_port},
                      datagram->payload);
  }
  const Replay replay({(folder / "positions.pcap").string()});
  EXPECT_EQ(replay.run().status, 1);
  EXPECT_NE(replay.run().err.find("position packets of a Velodyne and no data packet: the lidar is present and sends"),
            std::string::npos)
      << replay.run().err;
}

TEST(Warnings, LockedPpsThatIsNotUsed) {
  constexpr std::size_t kPpsAt = 0xCA, kNmeaAt = 0xCE;
  constexpr std::string_view kGga = "$GPGGA,220243.00,3708.5809,N,12156.8012,W,1,08,1.0,12.0,M,,M,,*5D\r\n";
  const TemporaryFolder folder;
  rewrite(room_drive() / "lidar.pcap", folder / "lidar.pcap", [&](UdpAddresses&, Bytes& payload) {
    if (payload.size() != velodyne::kPositionPacketBytes)
      return;
    payload[kPpsAt] = std::byte{2};
    std::memcpy(&payload[kNmeaAt], kGga.data(), kGga.size());
  });
  expect_warning({folder / "lidar.pcap"}, {"lidar front: its PPS is locked, but its time is not used", "no RMC"});
}

TEST(Warnings, OneOfTwoLidarsWithoutPackets) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), std::chrono::seconds{2}, 2);
  expect_warning(
      {"--set", "lidars.rear.port=3000", folder.path().string()},
      {"lidar rear: no valid data packet to port 3000", "packets went to port 2369", "--set lidars.rear.port=2369"});
  expect_warning({"--set", "lidars.rear.source_ip=10.0.0.9", folder.path().string()},
                 {"lidar rear: no valid data packet to port 2369 from 10.0.0.9", "rejected: sender"});
}

/// Regression: the packets of the second lidar were rejected without a message.
TEST(Warnings, TwoLidarsOnOnePortAreNamedWithTheConfigurationThatSeparatesThem) {
  const TemporaryFolder folder;
  write_room_drive(folder / "two", std::chrono::seconds{2}, 2);
  const std::string capture = folder / "one_port.pcap";
  rewrite(folder / "two/lidar.pcap", capture, [](UdpAddresses& addresses, Bytes& payload) {
    if (payload.size() == velodyne::kDataPacketBytes)
      addresses.destination_port = 2368;
  });
  expect_warning({capture}, {"lidar front: other senders use its port 2368", "packets from 192.168.1.201 are used",
                             " from 192.168.1.202 are rejected",
                             "lidars: [{name: front, port: 2368, source_ip: 192.168.1.201}, {name: front_2, port: "
                             "2368, source_ip: 192.168.1.202}]"});
  std::ofstream(folder / "both.yaml") << "lidars: [{name: front, port: 2368, source_ip: 192.168.1.201}, "
                                         "{name: front_2, port: 2368, source_ip: 192.168.1.202}]\n"
                                         "motion_sources: []\n";
  const Replay both({"-c", folder / "both.yaml", capture});
  EXPECT_EQ(both.run().err, "");
  EXPECT_EQ(both.summary()["packets"]["front"]["data"], both.summary()["packets"]["front_2"]["data"]);
  EXPECT_EQ(both.summary()["packets"]["total"]["rejected"]["sender"], 0);
}

TEST(Warnings, PacketsOfAnUnknownModelAreNamedByTheirProductId) {
  const TemporaryFolder folder;
  const std::string capture = folder / "unknown.pcap";
  rewrite(room_drive() / "lidar.pcap", capture, [number = 0](UdpAddresses&, Bytes& payload) mutable {
    if (payload.size() == velodyne::kDataPacketBytes && ++number % 2 == 0)
      payload[velodyne::kProductIdOffset] = std::byte{0x31};
  });
  expect_warning({"--duration", "1", capture},
                 {"lidar front: rejected product id 0x31 and return mode 0x37 in ", "lidars.front.source_ip"});
  rewrite(room_drive() / "lidar.pcap", capture, [](UdpAddresses&, Bytes& payload) {
    if (payload.size() == velodyne::kDataPacketBytes)
      payload[velodyne::kProductIdOffset] = std::byte{0x63};
  });
  const Replay none({capture});
  EXPECT_EQ(none.run().status, 1);
  EXPECT_NE(none.run().err.find("(product id 0x63 and return mode 0x37 in "), std::string::npos) << none.run().err;
}

/// Consecutive half turns do not overlap. No source is blamed for that, and the motion sources bridge the gaps.
TEST(Warnings, SweepShorterThanARevolution) {
  const std::vector<std::string> halves = {"--set", "sweep_period_ms=50", "--duration", "6", room_drive().string()};
  expect_warning(halves, {"lidar front: one revolution takes 100 ms, so each sweep of 50 ms covers only",
                          "sweep_period_ms: auto"});
  EXPECT_LT(Replay(halves).summary()["ape_m"]["max"], 0.01);
}

/// The true speed is up to 1 m/s. Lidar is still correct.
TEST(Warnings, RobotFasterThanConfigured) {
  const Replay replay({"--set", "motion.max_speed_mps=0.3", room_drive().string()});
  const std::vector<std::string> lines = lines_of(replay.run().err);
  ASSERT_EQ(lines.size(), 2U) << replay.run().err;
  EXPECT_NE(lines[0].find("motion source wio claims a higher speed than motion.max_speed_mps"), std::string::npos);
  EXPECT_NE(lines[1].find("estimates reach "), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find("above motion.max_speed_mps of 0.3"), std::string::npos) << lines[1];
  EXPECT_LT(replay.summary()["ape_m"]["max"], 0.02);
}

TEST(Warnings, MotionOfAnotherTimeNamesBothSpans) {
  const TemporaryFolder folder;
  std::ofstream(folder / "wio.tum") << "10 0 0 0 0 0 0 1\n12.5 0 0 0 0 0 0 1\n";
  expect_warning({"--odometry", "wio=" + (folder / "wio.tum").string(), "--duration", "1", room_drive().string()},
                 {"wio.tum: its samples (10.000 to 12.500 s) and the packets (1700000000.0", "no time in common"});
  std::ofstream(folder / "imu.csv") << "t_ns,wx,wy,wz,ax,ay,az\n";
  expect_warning({"--imu", folder / "imu.csv", "--duration", "1", room_drive().string()},
                 {"imu.csv: its samples (none)"});
}

TEST(Warnings, SourceLostByAFaultIsNotReported) {
  EXPECT_EQ(Replay({"--fail", "wio:lost@0", "--duration", "1", room_drive().string()}).run().err, "");
}

} // namespace
} // namespace locus::test
