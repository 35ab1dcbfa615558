// SPDX-License-Identifier: Apache-2.0
// Bags of the room drive during which the clock of the only computer was set: that of the recorder and of all drivers.
#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "mcap_text.hpp"
#include "replay_run.hpp"
#include "support/clouds.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::function<Stamp(Stamp)>; ///< what the computer's clock shows at a time

enum class Form { ros1, db3, mcap, mcap_without_chunks };

RosVersion ros_of(Form form) { return form == Form::ros1 ? RosVersion::ros1 : RosVersion::ros2; }

Replay replay_bag_in_form(const std::vector<RecordedMessage>& messages, Form form) {
  const TemporaryFolder folder;
  const std::string file = folder / (form == Form::ros1 ? "drive.bag" : form == Form::db3 ? "drive.db3" : "drive.mcap");
  if (form == Form::db3)
    write_db3(file, messages);
  else
    std::ofstream{file, std::ios::binary}
        << (form == Form::ros1 ? ros1_bag(messages)
                               : mcap_file(messages, RosVersion::ros2, {.chunked = form == Form::mcap}));
  return Replay({file});
}

/// Moves the stamp in the header, which follows the encapsulation of ROS 2 or the sequence number of ROS 1.
void set_header(RecordedMessage& message, const Clock& clock) {
  constexpr std::size_t kStamp = 4;
  std::array<std::int32_t, 2> parts{}; // seconds, nanoseconds
  std::memcpy(parts.data(), message.data.data() + kStamp, sizeof(parts));
  const std::int64_t ns = to_ns(clock(Stamp{seconds{parts[0]} + std::chrono::nanoseconds{parts[1]}}));
  parts = {static_cast<std::int32_t>(ns / 1'000'000'000), static_cast<std::int32_t>(ns % 1'000'000'000)};
  std::memcpy(message.data.data() + kStamp, parts.data(), sizeof(parts));
}

std::vector<RecordedMessage> recorded_by(const Clock& clock, std::vector<RecordedMessage> messages) {
  for (RecordedMessage& message : messages)
    message.recorded = clock(message.recorded);
  return messages;
}

/// Clock of the driver whose messages scan_by_set_clock() makes.
Clock clock_of_driver; // NOLINT(cert-err58-cpp): empty

std::vector<std::byte> scan_by_set_clock(std::span<const ReceivedPacket> packets, RosVersion ros) {
  std::vector<ReceivedPacket> stamped(packets.begin(), packets.end());
  for (ReceivedPacket& packet : stamped)
    packet.stamp = clock_of_driver(packet.stamp);
  return scan_message(stamped, ros);
}

std::vector<RecordedMessage> packets_by(const Clock& clock, Form form) {
  clock_of_driver = clock;
  std::vector<RecordedMessage> messages = messages_of(room_drive(), ros_of(form), scan_by_set_clock);
  for (RecordedMessage& message : messages) {
    if (!message.topic.ends_with("packets"))
      set_header(message, clock);
  }
  return recorded_by(clock, std::move(messages));
}

/// Stamps in the headers of clouds: by the driver, or by the lidar, whose clock nobody sets.
enum class Headers { of_driver, of_lidar };

/// Skips the standstill, during which micrometres decide whether the robot is at rest.
std::vector<RecordedMessage> clouds_by(const Clock& clock, CloudKind kind, Headers headers, Form form) {
  constexpr std::size_t kPacketsLeftOut = 35 * 76;
  std::vector<OwnCloud> clouds;
  std::vector<Stamp> ends;
  for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap", kPacketsLeftOut)) {
    clouds.push_back(cloud_of(turn, kind));
    ends.push_back(turn.end());
  }
  std::vector<RecordedMessage> messages = messages_of(room_drive(), clouds, ends, ros_of(form));
  for (RecordedMessage& message : messages) {
    if (message.topic != "/points" || headers == Headers::of_driver)
      set_header(message, clock);
  }
  return recorded_by(clock, std::move(messages));
}

Stamp true_time(Stamp stamp) { return stamp; }

/// Clock that is set in the middle of the drive.
Clock clock_set_by(Duration step) {
  const Stamp at = messages_of(room_drive(), RosVersion::ros2).front().recorded + milliseconds{5'530};
  return [=](Stamp stamp) { return stamp < at ? stamp : stamp + step; };
}

/// Expects the poses of the sound bag to a millimetre, and one warning.
void expect_poses_of_sound_bag(const Replay& replay, const Replay& sound, const std::string& warning) {
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  EXPECT_NE(replay.run().err.find(warning), std::string::npos) << replay.run().err;
  const std::vector<StampedPose> poses = replay.trajectory(), expected = sound.trajectory();
  ASSERT_GT(expected.size(), 30U);
  ASSERT_EQ(poses.size(), expected.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT((poses[i].T_source_base.translation - expected[i].T_source_base.translation).norm(), 0.001) << i;
    EXPECT_LT(std::abs(to_seconds(poses[i].stamp - expected[i].stamp)), 1e-3) << i;
  }
}

class ClockStepsInBags : public testing::TestWithParam<Form> {};

TEST_P(ClockStepsInBags, OfPacketsAreUndone) {
  const Replay sound = replay_bag_in_form(packets_by(true_time, GetParam()), GetParam());
  EXPECT_EQ(sound.run().err, "");
  for (const Duration step :
       {Duration{-hours{1}}, Duration{-seconds{3}}, Duration{-milliseconds{300}}, Duration{hours{1}}}) {
    SCOPED_TRACE(to_seconds(step));
    const Replay replay = replay_bag_in_form(packets_by(clock_set_by(step), GetParam()), GetParam());
    expect_poses_of_sound_bag(replay, sound, "the clock of the recording computer was set by ");
    EXPECT_EQ(replay.summary()["packets"]["total"]["clock_steps"], 0);
  }
}

TEST_P(ClockStepsInBags, OfCloudsAreUndone) {
  const auto replay_clouds = [](const Clock& clock) {
    return replay_bag_in_form(clouds_by(clock, CloudKind::velodyne, Headers::of_driver, GetParam()), GetParam());
  };
  const Replay sound = replay_clouds(true_time);
  EXPECT_EQ(sound.run().err, "");
  for (const Duration step :
       {Duration{-hours{1}}, Duration{-seconds{3}}, Duration{-milliseconds{300}}, Duration{hours{24 * 2000}}}) {
    SCOPED_TRACE(to_seconds(step));
    expect_poses_of_sound_bag(replay_clouds(clock_set_by(step)), sound,
                              "the clock of the recording computer was set by ");
  }
}
INSTANTIATE_TEST_SUITE_P(Forms, ClockStepsInBags,
                         testing::Values(Form::ros1, Form::db3, Form::mcap, Form::mcap_without_chunks));

TEST(ClockSteps, OfCloudsAreUndoneWhateverStampsThem) {
  for (const CloudKind kind : {CloudKind::ouster, CloudKind::hesai, CloudKind::livox_custom}) {
    const Headers headers = kind == CloudKind::hesai ? Headers::of_lidar : Headers::of_driver;
    SCOPED_TRACE(name_of(kind));
    const Replay sound = replay_bag_in_form(clouds_by(true_time, kind, headers, Form::mcap), Form::mcap);
    EXPECT_EQ(sound.run().err, "");
    const Replay replay =
        replay_bag_in_form(clouds_by(clock_set_by(-seconds{30}), kind, headers, Form::mcap), Form::mcap);
    expect_poses_of_sound_bag(replay, sound, "the clock of the recording computer was set by -30.");
  }
}

TEST(ClockSteps, OfOneRecordingAreReportedOnce) {
  const Stamp start = messages_of(room_drive(), RosVersion::ros2).front().recorded;
  const Clock twice = [=](Stamp stamp) {
    const Duration since = stamp - start;
    return stamp - (since < milliseconds{4'710} ? Duration{} : since < milliseconds{6'230} ? seconds{20} : seconds{25});
  };
  const auto replay_clouds = [](const Clock& clock) {
    return replay_bag_in_form(clouds_by(clock, CloudKind::velodyne, Headers::of_driver, Form::db3), Form::db3);
  };
  expect_poses_of_sound_bag(replay_clouds(twice), replay_clouds(true_time), "was set 2 times, first by -20.");
}

/// The inputs that --mcap writes have the steady times, so their replay has no step.
TEST(ClockSteps, AreNotInTheInputsWritten) {
  const TemporaryFolder folder;
  const std::string bag = folder / "set.db3", written = folder / "out.mcap";
  write_db3(bag, clouds_by(clock_set_by(-seconds{30}), CloudKind::velodyne, Headers::of_driver, Form::db3));
  const Replay first({"--mcap", written, bag}), again({written});
  EXPECT_EQ(again.run().err, "");
  EXPECT_EQ(read_text(first.file("odometry.tum")), read_text(again.file("odometry.tum")));
}

} // namespace
} // namespace locus::test
