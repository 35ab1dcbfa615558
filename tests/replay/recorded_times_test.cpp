// SPDX-License-Identifier: Apache-2.0
// Recordings whose times of arrival are not what they should be.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
#include "drivers/velodyne/model.hpp"
#include "drivers/wire.hpp"
#include "replay_run.hpp"
#include "support/temporary_folder.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// Writes the lidar's packets of the room drive, each with the arrival that `change` makes of the time since the first.
std::string capture_with(const TemporaryFolder& folder, const std::function<Stamp(Stamp arrival, Duration)>& change) {
  std::string name = folder / "lidar_alone.pcap";
  auto capture = Capture::open(room_drive() / "lidar.pcap");
  auto writer = PcapWriter::open(name);
  std::optional<Stamp> first;
  while (const Datagram* datagram = capture->next()) {
    first = first.value_or(datagram->receive_stamp);
    writer->write(change(datagram->receive_stamp, datagram->receive_stamp - *first),
                  {.source_ip = datagram->source_ip, .destination_port = datagram->destination_port},
                  datagram->payload);
  }
  return name;
}

const std::vector<StampedPose>& expected() {
  static const std::vector<StampedPose> poses = [] {
    const TemporaryFolder folder;
    return Replay({capture_with(folder, [](Stamp arrival, Duration) { return arrival; })}).trajectory();
  }();
  return poses;
}

/// Expects the poses of the sound recording, sweep by sweep but for the edges, and one warning.
void expect_same_way(const Replay& replay, const std::string& warning, std::size_t warnings = 1) {
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_NE(replay.run().err.find(warning), std::string::npos) << replay.run().err;
  EXPECT_EQ(lines_of(replay.run().err).size(), warnings) << replay.run().err;
  const std::vector<StampedPose> poses = replay.trajectory();
  ASSERT_GT(poses.size(), 10U);
  EXPECT_LE(std::abs(std::ssize(poses) - std::ssize(expected())), 1);
  const Eigen::Vector3d end = poses.back().T_source_base.translation;
  double nearest_m = 1e9;
  for (const StampedPose& pose : expected())
    nearest_m = std::min(nearest_m, (pose.T_source_base.translation - end).norm());
  EXPECT_LT(nearest_m, 0.02);
  for (std::size_t i = 1; i < poses.size(); ++i)
    EXPECT_LT((poses[i].T_source_base.translation - poses[i - 1].T_source_base.translation).norm(), 0.3) << i;
}

TEST(RecordedTimes, ThatAreAllTheSameLeaveTheTimeToTheLidar) {
  for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{1'600'000'000'000'000'000}}) {
    const TemporaryFolder folder;
    const Replay replay({capture_with(folder, [&](Stamp, Duration) { return stamp_from_ns(ns); })});
    expect_same_way(replay, "the lidar's own clock tells the time");
    const std::vector<StampedPose> poses = replay.trajectory();
    ASSERT_FALSE(poses.empty());
    EXPECT_NEAR(to_seconds(poses.back().stamp - poses.front().stamp),
                to_seconds(expected().back().stamp - expected().front().stamp), 0.11);
  }
}

TEST(RecordedTimes, OfAClockThatWasSetDoNotTearTheWay) {
  for (const Duration step : {Duration{std::chrono::seconds{200'000'000}}, Duration{std::chrono::hours{-1}},
                              Duration{std::chrono::seconds{15}}}) {
    const TemporaryFolder folder;
    const Replay replay({capture_with(folder, [&](Stamp arrival, Duration since_start) {
      return since_start < std::chrono::seconds{3} ? arrival : arrival + step;
    })});
    expect_same_way(replay, "the clock of the recording computer was set by");
    const std::vector<StampedPose> poses = replay.trajectory();
    ASSERT_FALSE(poses.empty());
    EXPECT_EQ(poses.front().stamp, expected().front().stamp);
    const Duration kept = std::max(step, Duration{}); // rows do not go back
    EXPECT_NEAR(to_seconds(poses.back().stamp - expected().back().stamp - kept), 0.0, 1e-3);
  }
}

TEST(RecordedTimes, ALoneAbsurdOneChangesNothing) {
  const TemporaryFolder folder;
  int number = 0;
  const Replay replay({capture_with(folder, [&](Stamp arrival, Duration) {
    return ++number == 2'000 ? arrival + std::chrono::hours{24 * 365} : arrival;
  })});
  expect_same_way(replay, "the clock of the recording computer was set by", 2); // forth and back
}

/// Lidar and recording computer go on for half a minute that was not recorded.
TEST(RecordedTimes, WithAPauseAreNoClockThatWasSet) {
  constexpr std::uint32_t kPause_s = 30, kHour_us = 3'600'000'000;
  const TemporaryFolder folder;
  {
    auto capture = Capture::open(room_drive() / "lidar.pcap");
    auto writer = PcapWriter::open(folder / "pause.pcap");
    std::optional<Stamp> first;
    while (const Datagram* datagram = capture->next()) {
      first = first.value_or(datagram->receive_stamp);
      const bool is_after = datagram->receive_stamp - *first > std::chrono::seconds{3};
      Bytes payload(datagram->payload.begin(), datagram->payload.end());
      if (is_after && payload.size() == velodyne::kDataPacketBytes) {
        std::byte* const time = payload.data() + velodyne::kTimeOffset;
        put_little_endian(time, (read_u32(time) + std::uint64_t{1'000'000} * kPause_s) % kHour_us, 4);
      }
      writer->write(datagram->receive_stamp + std::chrono::seconds{is_after ? kPause_s : 0},
                    {.source_ip = datagram->source_ip, .destination_port = datagram->destination_port}, payload);
    }
  }
  const Replay replay({(folder / "pause.pcap").string()});
  EXPECT_EQ(replay.run().err.find("was set by"), std::string::npos) << replay.run().err;
}

std::vector<std::byte> constant_stamps(std::span<const ReceivedPacket> packets, RosVersion ros) {
  std::vector<ReceivedPacket> changed(packets.begin(), packets.end());
  for (ReceivedPacket& packet : changed)
    packet.stamp = stamp_from_ns(904'636'608'000'032'663);
  return scan_message(changed, ros);
}

/// An hour back in the messages of half a second.
std::vector<std::byte> stamps_an_hour_back(std::span<const ReceivedPacket> packets, RosVersion ros) {
  static std::optional<Stamp> first;
  first = first.value_or(packets.front().stamp);
  std::vector<ReceivedPacket> changed(packets.begin(), packets.end());
  const Duration since = packets.front().stamp - *first;
  for (ReceivedPacket& packet : changed)
    packet.stamp -= since > std::chrono::seconds{3} && since < std::chrono::milliseconds{3'500} ? std::chrono::hours{1}
                                                                                                : std::chrono::hours{0};
  return scan_message(changed, ros);
}

TEST(RecordedTimes, OfTheRecorderReplaceStampsOfADriverThatStandStillOrLeap) {
  const TemporaryFolder usual;
  write_db3(usual / "drive.db3", messages_of(room_drive(), RosVersion::ros2));
  const Replay sound({"-c", room_drive() / "config.yaml", (usual / "drive.db3").string()});
  for (auto* const message : {&constant_stamps, &stamps_an_hour_back}) {
    const TemporaryFolder folder;
    write_db3(folder / "drive.db3", messages_of(room_drive(), RosVersion::ros2, *message));
    const Replay replay({"-c", room_drive() / "config.yaml", (folder / "drive.db3").string()});
    EXPECT_EQ(replay.run().status, 0);
    EXPECT_NE(replay.run().err.find("the time of their recording is used"), std::string::npos) << replay.run().err;
    const nlohmann::json summary = replay.summary();
    EXPECT_GT(summary["sweeps"]["processed"], sound.summary()["sweeps"]["processed"].get<int>() - 4);
    EXPECT_EQ(summary["packets"]["total"]["lost"], sound.summary()["packets"]["total"]["lost"]);
    EXPECT_GT(summary["sources"]["wio"]["used_sweeps"], 50);
    const Eigen::Vector3d end = replay.trajectory().back().T_source_base.translation;
    double nearest_m = 1e9;
    for (const StampedPose& pose : sound.trajectory())
      nearest_m = std::min(nearest_m, (pose.T_source_base.translation - end).norm());
    EXPECT_LT(nearest_m, 0.1);
  }
}

} // namespace
} // namespace locus::test
