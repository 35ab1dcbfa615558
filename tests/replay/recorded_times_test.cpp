// SPDX-License-Identifier: Apache-2.0
// Recordings whose times of arrival are not what they should be.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
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
    ASSERT_FALSE(poses.empty());
    EXPECT_NEAR(to_seconds(poses.back().stamp - poses.front().stamp),
                to_seconds(expected().back().stamp - expected().front().stamp), 0.11);
  }
}

} // namespace
} // namespace locus::test
