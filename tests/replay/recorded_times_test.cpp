// SPDX-License-Identifier: Apache-2.0
// Recordings whose times of arrival are not what they should be.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "drivers/files/capture.hpp"
#include "drivers/files/pcap_writer.hpp"
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
void expect_same_way(const Replay& replay, const std::string& warning) {
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_NE(replay.run().err.find(warning), std::string::npos) << replay.run().err;
  EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
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

TEST(RecordedTimes, ConstantTimesAreReplacedByTheLidarClock) {
  for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{1'600'000'000'000'000'000}}) {
    const TemporaryFolder folder;
    const Replay replay({capture_with(folder, [&](Stamp, Duration) { return stamp_from_ns(ns); })});
    expect_same_way(replay, "those of the lidar's own clock are used");
    const std::vector<StampedPose> poses = replay.trajectory();
    ASSERT_EQ(poses.size(), expected().size());
    const auto since_first_s = [](const std::vector<StampedPose>& all, std::size_t i) {
      return to_seconds(all[i].stamp - all.front().stamp);
    };
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_NEAR(since_first_s(poses, i), since_first_s(expected(), i), 0.001) << i;
      EXPECT_LT((poses[i].T_source_base.translation - expected()[i].T_source_base.translation).norm(), 0.001) << i;
    }
  }
}

/// The room drive, with other times.
class RoomDriveWithTimes {
 public:
  using Change = std::function<Stamp(Stamp)>;

  /// Changes the times of all files: the clock of the computer that recorded all of them was set.
  explicit RoomDriveWithTimes(const Change& change) : RoomDriveWithTimes(change, change, change) {}
  RoomDriveWithTimes(const Change& of_lidar, const Change& of_imu, const Change& of_rest) {
    std::filesystem::rename(capture_with(folder_, [&](Stamp arrival, Duration) { return of_lidar(arrival); }),
                            folder_ / "lidar.pcap");
    std::filesystem::copy(room_drive() / "config.yaml", folder_ / "config.yaml");
    std::ofstream imu(folder_ / "imu.csv"), wio(folder_ / "wio.tum"), truth(folder_ / "gt.tum");
    for (ImuSample sample : MotionSamples<ImuSample>::open(room_drive() / "imu.csv")->drain()) {
      sample.stamp = of_imu(sample.stamp);
      imu << to_line(sample);
    }
    for (const auto& [file, out] : {std::pair{"wio.tum", &wio}, {"gt.tum", &truth}}) {
      for (StampedPose pose : read_tum(room_drive() / file)) {
        pose.stamp = of_rest(pose.stamp);
        *out << to_line(pose);
      }
    }
  }
  [[nodiscard]] std::string folder() const { return folder_ / ""; }

 private:
  TemporaryFolder folder_;
};

RoomDriveWithTimes::Change unchanged() {
  return [](Stamp stamp) { return stamp; };
}

/// Clock that is set in the middle of the room drive.
RoomDriveWithTimes::Change set_by(Duration step) {
  const Stamp start = Capture::open(room_drive() / "lidar.pcap")->next()->receive_stamp;
  return [=](Stamp stamp) { return stamp < start + std::chrono::seconds{4} ? stamp : stamp + step; };
}

const Replay& replay_with_own_times() {
  static const RoomDriveWithTimes drive(unchanged());
  static const Replay replay({drive.folder()});
  return replay;
}

/// Expects the poses of the unchanged drive, one for one, within `error_m`.
void expect_poses_of_room_drive(const Replay& replay, double error_m) {
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<StampedPose> poses = replay.trajectory(), sound = replay_with_own_times().trajectory();
  ASSERT_EQ(poses.size(), sound.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT((poses[i].T_source_base.translation - sound[i].T_source_base.translation).norm(), error_m) << i;
    EXPECT_LT(std::abs(to_seconds(poses[i].stamp - sound[i].stamp)), 1e-3) << i;
  }
}

TEST(RecordedTimes, TimesAfterAClockStepContinueFromBefore) {
  using std::chrono::seconds;
  for (const Duration step : std::initializer_list<Duration>{
           seconds{200'000'000}, -seconds{200'000'000}, std::chrono::hours{1}, -std::chrono::hours{1}, seconds{30},
           -seconds{30}, -seconds{3}, seconds{1}, -seconds{1}, std::chrono::milliseconds{-300}}) {
    SCOPED_TRACE(to_seconds(step));
    const RoomDriveWithTimes drive(set_by(step));
    const Replay replay({drive.folder()});
    expect_poses_of_room_drive(replay, 0.002);
    EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
    EXPECT_NE(replay.run().err.find("the clock of the recording computer was set"), std::string::npos);
    EXPECT_NEAR(replay.summary()["ape_m"]["max"], replay_with_own_times().summary()["ape_m"]["max"], 0.002);
    EXPECT_EQ(replay.summary()["packets"]["total"]["clock_steps"], 0);
  }
}

TEST(RecordedTimes, ClockStepBeforeThePartPlayedIsReportedOnce) {
  const Replay sound({"--start", "5", RoomDriveWithTimes(unchanged()).folder()});
  for (const int step_s : {200'000'000, -3600, -3}) {
    const Replay replay({"--start", "5", RoomDriveWithTimes(set_by(std::chrono::seconds{step_s})).folder()});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
    EXPECT_EQ(replay.trajectory().size(), sound.trajectory().size());
    EXPECT_NEAR(replay.summary()["ape_m"]["max"], sound.summary()["ape_m"]["max"], 0.002);
  }
}

TEST(RecordedTimes, ClockStepDoesNotMoveLidarAlone) {
  for (const int step_s : {200'000'000, 3600, 1, -20}) {
    const TemporaryFolder folder;
    const auto change = set_by(std::chrono::seconds{step_s});
    const Replay replay({capture_with(folder, [&](Stamp arrival, Duration) { return change(arrival); })});
    expect_same_way(replay, "the clock of the recording computer was set");
    EXPECT_EQ(replay.trajectory().size(), expected().size()) << step_s;
  }
}

TEST(RecordedTimes, ClockSetTwiceIsReportedOnce) {
  const auto once = set_by(std::chrono::hours{1});
  const Stamp start = Capture::open(room_drive() / "lidar.pcap")->next()->receive_stamp;
  const auto back = start + std::chrono::hours{1} + std::chrono::milliseconds{4600};
  const RoomDriveWithTimes drive([&](Stamp stamp) {
    const Stamp first = once(stamp);
    return first < back ? first : stamp;
  });
  const Replay replay({drive.folder()});
  expect_poses_of_room_drive(replay, 0.002);
  EXPECT_NE(replay.run().err.find("was set 2 times"), std::string::npos) << replay.run().err;
}

/// A source with a clock of its own, which nobody set.
TEST(RecordedTimes, TimesOfAnotherClockDoNotFollowAClockStep) {
  const RoomDriveWithTimes drive(set_by(std::chrono::hours{1}), unchanged(), set_by(std::chrono::hours{1}));
  const Replay replay({drive.folder()});
  expect_poses_of_room_drive(replay, 0.002);
  EXPECT_EQ(replay.summary()["sources"]["imu"]["used_sweeps"],
            replay_with_own_times().summary()["sources"]["imu"]["used_sweeps"]);
}

TEST(RecordedTimes, TimesOfASourceContinueAfterItsClockStep) {
  for (const int step_s : {-3, -3600, 200'000'000}) {
    const RoomDriveWithTimes drive(unchanged(), set_by(std::chrono::seconds{step_s}), unchanged());
    const Replay replay({drive.folder()});
    expect_poses_of_room_drive(replay, 0.02);
    EXPECT_NE(replay.run().err.find("imu.csv: its times jump 1 times"), std::string::npos) << replay.run().err;
    EXPECT_EQ(lines_of(replay.run().err).size(), 1U) << replay.run().err;
  }
}

/// The packets of 0.4 s arrive in a burst.
TEST(RecordedTimes, DelayedPacketsAreNoClockStep) {
  const TemporaryFolder folder;
  const auto delayed = [](Stamp arrival, Duration since_start) {
    using std::chrono::milliseconds;
    return since_start < milliseconds{4000} ? arrival
                                            : arrival + std::max(Duration{}, milliseconds{4400} - since_start);
  };
  const Replay replay({capture_with(folder, delayed)});
  EXPECT_EQ(replay.run().err, "");
  EXPECT_EQ(replay.trajectory().size(), expected().size());
}

TEST(RecordedTimes, TruthGoingBackAloneIsAnError) {
  const RoomDriveWithTimes drive(unchanged(), unchanged(), set_by(-std::chrono::seconds{3}));
  const Replay replay({drive.folder()});
  EXPECT_EQ(replay.run().status, 1);
  EXPECT_NE(replay.run().err.find("gt.tum: its times jump at"), std::string::npos) << replay.run().err;
}

} // namespace
} // namespace locus::test
