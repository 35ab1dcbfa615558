// SPDX-License-Identifier: Apache-2.0
// What is unlikely to be what the user meant, and used to pass in silence.
#include <fstream>

#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

/// A run that succeeds, with one warning that says all this.
void expect_warning(const std::vector<std::string>& arguments, const std::vector<std::string>& said) {
  const Replay replay(arguments);
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  const std::vector<std::string> lines = lines_of(replay.run().err);
  ASSERT_EQ(lines.size(), 1U) << replay.run().err;
  EXPECT_TRUE(lines[0].starts_with("locus-replay: warning: ")) << lines[0];
  for (const std::string& part : said)
    EXPECT_NE(lines[0].find(part), std::string::npos) << "no '" << part << "' in: " << lines[0];
}

TEST(Warnings, NoneWhereAllIsWell) {
  EXPECT_EQ(Replay({"--set", "lidars.front.model=VLP-16", room_drive().string()}).run().err, "");
}

/// Read as a VLP-32C's, the packets of a VLP-16 make a smooth path through a wrong world.
TEST(Warnings, PacketsOfAnotherModelThanTheConfiguredOne) {
  expect_warning({"--set", "lidars.front.model=VLP-32C", "--duration", "2", room_drive().string()},
                 {"lidar front: configured as VLP-32C", "those of a VLP-16", "--set lidars.front.model=auto"});
}

TEST(Warnings, LidarThatIsNotHeardWhileAnotherIs) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), std::chrono::seconds{2}, 2);
  expect_warning(
      {"--set", "lidars.rear.port=3000", folder.path().string()},
      {"lidar rear: no valid data packet to port 3000", "packets went to port 2369", "--set lidars.rear.port=2369"});
  expect_warning({"--set", "lidars.rear.source_ip=10.0.0.9", folder.path().string()},
                 {"lidar rear: no valid data packet to port 2369 from 10.0.0.9", "rejected: sender"});
}

/// Half a turn sees what the half before did not: each second sweep fails.
TEST(Warnings, SweepThatIsShorterThanATurn) {
  expect_warning({"--set", "sweep_period_ms=50", "--duration", "2", room_drive().string()},
                 {"lidar front: turns in 100 ms, so a sweep of 50 ms sees a part", "sweep_period_ms: auto"});
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

TEST(Warnings, SourceThatIsLostOnPurposeIsNotBlamed) {
  EXPECT_EQ(Replay({"--fail", "wio:lost@0", "--duration", "1", room_drive().string()}).run().err, "");
}

} // namespace
} // namespace locus::test
