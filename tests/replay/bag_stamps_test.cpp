// SPDX-License-Identifier: Apache-2.0
// Bags whose drivers stamp or name their packets wrongly.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Replays the room drive as a bag.
Replay replay_bag(const std::vector<RecordedMessage>& messages) {
  const TemporaryFolder folder;
  const std::string file = folder / "drive.db3";
  write_db3(file, messages);
  return Replay({"-c", room_drive() / "config.yaml", "--ground-truth", room_drive() / "gt.tum", file});
}

const Replay& sound_replay() {
  static const Replay replay = replay_bag(messages_of(room_drive(), RosVersion::ros2));
  return replay;
}

/// How the driver stamps a packet received at a time.
std::function<Stamp(Stamp)> driver;

std::vector<std::byte> scan_by_driver(std::span<const ReceivedPacket> packets, RosVersion ros) {
  std::vector<ReceivedPacket> stamped(packets.begin(), packets.end());
  for (ReceivedPacket& packet : stamped)
    packet.stamp = driver(packet.stamp);
  return scan_message(stamped, ros);
}

std::vector<RecordedMessage> messages_by_driver(std::function<Stamp(Stamp)> stamps) {
  driver = std::move(stamps);
  return messages_of(room_drive(), RosVersion::ros2, scan_by_driver);
}

/// Expects the odometry of the sound bag to 2 mm, sweep for sweep, and one warning that contains `warning`.
void expect_odometry_of_sound_bag(const Replay& replay, const std::string& warning) {
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(lines_of(replay.run().err).size(), warning.empty() ? 0U : 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find(warning), std::string::npos) << replay.run().err;
  EXPECT_EQ(replay.trajectory().size(), sound_replay().trajectory().size());
  const auto now = replay.summary(), sound = sound_replay().summary();
  EXPECT_NEAR(now["ape_m"]["mean"], sound["ape_m"]["mean"], 0.002);
  EXPECT_NEAR(now["ape_m"]["max"], sound["ape_m"]["max"], 0.005);
  EXPECT_EQ(now["packets"]["total"]["lost"], 0);
  EXPECT_EQ(now["packets"]["total"]["rejected"], sound["packets"]["total"]["rejected"]);
  EXPECT_GE(now["sources"]["imu"]["used_sweeps"], static_cast<int>(sound["sources"]["imu"]["used_sweeps"]) - 1);
}

Stamp drive_start() { return messages_of(room_drive(), RosVersion::ros2).front().recorded; }

TEST(BagStamps, ConstantOrZeroStampsAreReplacedByTheRecorders) {
  for (const Stamp constant : {Stamp{}, stamp_from_ns(904'636'608'000'032'663), drive_start() + hours{24}}) {
    SCOPED_TRACE(to_ns(constant));
    expect_odometry_of_sound_bag(replay_bag(messages_by_driver([=](Stamp) { return constant; })),
                                 "constant, zero or absurd: the times at which the bag was recorded are used instead");
  }
}

TEST(BagStamps, ConstantStampsWithinMessagesAreReplacedByTheRecorders) {
  const Stamp start = drive_start();
  const auto of_tenth = [=](Stamp stamp) { return stamp - (stamp - start) % milliseconds{200}; };
  const Replay replay = replay_bag(messages_by_driver(of_tenth));
  expect_odometry_of_sound_bag(replay, "constant, zero or absurd");
}

TEST(BagStamps, TemporarilyWrongStampsAreReplacedByTheRecorders) {
  const Stamp start = drive_start();
  for (const Duration off :
       {Duration{-hours{1}}, Duration{hours{1}}, Duration{-seconds{5}}, Duration{hours{24 * 9000}}}) {
    SCOPED_TRACE(to_seconds(off));
    const auto stamps = [=](Stamp stamp) {
      return stamp >= start + seconds{3} && stamp < start + milliseconds{3500} ? stamp + off : stamp;
    };
    expect_odometry_of_sound_bag(replay_bag(messages_by_driver(stamps)), "constant, zero or absurd");
  }
}

TEST(BagStamps, InitiallyWrongStampsAreReplacedByTheRecorders) {
  const Stamp start = drive_start();
  const auto stamps = [=](Stamp stamp) { return stamp < start + milliseconds{300} ? stamp - hours{24 * 365} : stamp; };
  expect_odometry_of_sound_bag(replay_bag(messages_by_driver(stamps)), "constant, zero or absurd");
}

TEST(BagStamps, FinallyWrongStampsAreReplacedByTheRecorders) {
  const Stamp start = drive_start();
  const auto stamps = [=](Stamp stamp) { return stamp < start + seconds{4} ? stamp : stamp + hours{2}; };
  expect_odometry_of_sound_bag(replay_bag(messages_by_driver(stamps)), "constant, zero or absurd");
}

/// The recorder ran on another computer than all drivers.
TEST(BagStamps, OfOneClockMatchWhateverTheRecordersClock) {
  for (const Duration ahead : {Duration{hours{24 * 365}}, Duration{-hours{5}}, Duration{seconds{4}}}) {
    SCOPED_TRACE(to_seconds(ahead));
    std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
    for (RecordedMessage& message : messages)
      message.recorded += ahead;
    expect_odometry_of_sound_bag(replay_bag(messages), "");
  }
}

/// Returns the messages of the drive, those on one topic with other header stamps.
std::vector<RecordedMessage> with_stamps(const std::string& topic, const std::function<Stamp(Stamp)>& stamps) {
  std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  for (RecordedMessage& message : messages) {
    const std::int64_t ns = to_ns(stamps(message.recorded));
    const std::array parts{static_cast<std::int32_t>(ns / 1'000'000'000),
                           static_cast<std::int32_t>(ns % 1'000'000'000)};
    if (message.topic == topic)
      std::memcpy(message.data.data() + 4, parts.data(), sizeof(parts)); // the stamp follows the encapsulation
  }
  return messages;
}

TEST(BagStamps, WrongStampsOfSamplesAreReplacedByTheRecorders) {
  const Stamp start = drive_start();
  const auto hour_back = [=](Stamp stamp) {
    return stamp >= start + seconds{3} && stamp < start + milliseconds{3500} ? stamp - hours{1} : stamp;
  };
  const auto set = [=](Stamp stamp) { return stamp < start + seconds{5} ? stamp : stamp + hours{2}; };
  const auto constant = [](Stamp) { return stamp_from_ns(904'636'608'000'032'663); };
  for (const std::function<Stamp(Stamp)>& stamps : {std::function<Stamp(Stamp)>{hour_back}, {set}, {constant}}) {
    for (const std::string topic : {"/imu/data", "/wheel_odometry"}) {
      SCOPED_TRACE(topic);
      expect_odometry_of_sound_bag(replay_bag(with_stamps(topic, stamps)), topic + ": the stamps of ");
    }
  }
}

TEST(BagStamps, OfASourceWithAnotherClockAreConverted) {
  for (const Duration ahead : {Duration{hours{2}}, Duration{-hours{24 * 3650}}})
    expect_odometry_of_sound_bag(replay_bag(with_stamps("/imu/data", [=](Stamp stamp) { return stamp + ahead; })), "");
}

/// Two drivers without namespaces: the second lidar looks the other way.
TEST(BagStamps, SecondLidarOnATopicIsDistinguishedByItsFrame) {
  constexpr std::size_t kFrame = 16; ///< after encapsulation, stamp and length
  std::vector<RecordedMessage> messages = messages_of(room_drive(), RosVersion::ros2);
  std::vector<RecordedMessage> both;
  for (const RecordedMessage& message : messages) {
    both.push_back(message);
    if (!message.topic.ends_with("packets"))
      continue;
    both.push_back(message);
    both.back().recorded += milliseconds{1};
    both.back().data[kFrame] = std::byte{'R'};
  }
  const Replay replay = replay_bag(both);
  expect_odometry_of_sound_bag(replay, "several lidars publish on it: frame_id");
}

} // namespace
} // namespace locus::test
