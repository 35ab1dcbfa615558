// SPDX-License-Identifier: Apache-2.0
// Recordings of the service, and their replay.
#include <algorithm>
#include <csignal>
#include <fstream>

#include <sched.h>
#include <sys/mount.h>

#include <fmt/format.h>

#include "service/robot_network.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class Recording : public RobotNetwork {
 protected:
  /// A robot with two lidars that drives through the plant.
  [[nodiscard]] std::filesystem::path drive() const {
    std::filesystem::path folder = file("drive");
    const ProgramRun run =
        run_program(LOCUS_SIM, {"--world", "urban", "--robot", "husky", "--lidars", "2", "--duration", "8", "--seed",
                                "3", "--realism", "clean", "-o", folder.string()});
    EXPECT_EQ(run.status, 0) << run.err;
    return folder;
  }

  /// Returns the robot's configuration with recording enabled, to the state directory unless another folder is named.
  [[nodiscard]] std::filesystem::path recording(const std::filesystem::path& robot, std::uint64_t max_bytes,
                                                const std::string& folder = "record") const {
    std::filesystem::path path = file("recording.yaml");
    std::ofstream{path} << read_text(robot / "config.yaml")
                        << fmt::format("record: {{folder: {}, max_bytes: {}}}\n", folder, max_bytes);
    return path;
  }

  [[nodiscard]] std::vector<std::filesystem::path> runs() const { return folders_in(file("record")); }

  static std::vector<std::filesystem::path> folders_in(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      found.push_back(entry.path());
    std::ranges::sort(found);
    return found;
  }

  static std::uint64_t bytes_in(const std::filesystem::path& folder) {
    std::uint64_t bytes = 0;
    std::error_code vanished;
    for (std::filesystem::recursive_directory_iterator entry(folder, vanished), end; !vanished && entry != end;
         entry.increment(vanished))
      bytes += entry->is_regular_file(vanished) ? entry->file_size(vanished) : 0;
    return bytes;
  }
};

/// Number of received poses that the replay has at the same nanosecond, and their largest difference.
struct Agreement {
  std::size_t poses = 0;
  double worst_m = 0, worst_rad = 0;
};

Agreement agreement(const std::vector<StampedPose>& replay, const std::vector<HeardPose>& heard) {
  Agreement found;
  for (const HeardPose& pose : heard) {
    const auto same = std::ranges::find(replay, pose.stamp, &StampedPose::stamp);
    if (same == replay.end())
      continue;
    ++found.poses;
    found.worst_m = std::max(found.worst_m, (same->T_source_base.translation - pose.T_odom_base.translation).norm());
    found.worst_rad =
        std::max(found.worst_rad, angle_rad(same->T_source_base.rotation.conjugate() * pose.T_odom_base.rotation));
  }
  return found;
}

TEST_F(Recording, ReplayEqualsTheEstimatesOfTheService) {
  const std::filesystem::path robot = drive();
  Child daemon(led_locusd(recording(robot, 1'000'000'000)));
  Child listener({CYCLONE_PEER, "0", "listen", "/locus"});
  ASSERT_TRUE(hears_the_service(listener));
  Child play(leading_play({robot.string()}));
  ASSERT_EQ(play.wait_for_exit(patience_of_a_drive()), 0) << testing::PrintToString(play.lines());
  const auto received = [](const nlohmann::json& now) {
    return now["packets"]["total"]["received"].get<std::uint64_t>() +
           now["sources"]["imu"]["received"].get<std::uint64_t>() +
           now["sources"]["wio"]["received"].get<std::uint64_t>();
  };
  const nlohmann::json status = status_when([&](const auto& now) { // the disk thread yields to any other program
    return now["lidars"]["front"]["heard_ms_ago"] > 500 && now["recording"]["recorded"] == received(now);
  });
  EXPECT_EQ(status["recording"]["dropped"], 0);
  EXPECT_EQ(status["recording"]["problem"], "");
  EXPECT_EQ(status["recording"]["recorded"], received(status));
  EXPECT_EQ(status["sweeps"]["dropped"], 0);
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait_for_exit(), 0);

  ASSERT_EQ(runs().size(), 1U);
  EXPECT_TRUE(runs().front().filename().string().starts_with("000001_20")) << runs().front();
  const Replay replay({"--quiet", file("record").string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  const nlohmann::json packets_of_replay = replay.summary()["packets"];
  EXPECT_EQ(packets_of_replay.size(), 3U) << "two lidars and the total";
  for (const auto& [name, packets] : packets_of_replay.items())
    EXPECT_EQ(packets["data"], status["packets"][name]["data"]) << name;
  const Agreement live = agreement(replay.trajectory(), heard(listener));
  EXPECT_GE(live.poses, 77U) << "of 80";
  EXPECT_LT(live.worst_m, 2e-9) << "it was heard with nine decimals";
  EXPECT_LT(live.worst_rad, 1e-7);
  RecordProperty("live_worst_nm", static_cast<int>(1e9 * live.worst_m));

  const Replay original({"--quiet", robot.string()});
  ASSERT_EQ(original.run().status, 0) << original.run().err;
  EXPECT_LT(worst_distance_m(original.trajectory(), heard(listener), shift_of(play)), 0.01);
}

/// Power is cut in mid-drive; then the robot drives again, with disk space for six seconds of it.
TEST_F(Recording, OldestIsRemovedFirstAndAKilledRunReplays) {
  constexpr std::uint64_t kMaxBytes = 10'000'000;
  const std::filesystem::path robot = drive();
  {
    Child daemon(locusd(recording(robot, kMaxBytes)));
    ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
    const Child play(endlessly(robot));
    ASSERT_TRUE(daemon.wait_for_line("recording to")) << testing::PrintToString(daemon.lines());
    EXPECT_TRUE(comes_true([&] { return bytes_in(file("record")) > kMaxBytes / 2; }));
    daemon.signal(SIGKILL);
    EXPECT_EQ(daemon.wait_for_exit(), 128 + SIGKILL);
  }
  ASSERT_EQ(runs().size(), 1U);
  const std::filesystem::path killed = runs().front();
  const Replay first({"--quiet", killed.string()});
  EXPECT_EQ(first.run().status, 0) << first.run().err;
  EXPECT_GE(first.trajectory().size(), 15U);
  EXPECT_GT(folders_in(killed).size(), 2U) << "pieces";
  const Replay piece({"--quiet", folders_in(killed)[1].string()});
  EXPECT_EQ(piece.run().status, 0) << piece.run().err;
  EXPECT_GT(piece.trajectory().size(), 0U);

  const std::uint64_t of_killed = bytes_in(killed); // more than half if the test was slow to end it
  ASSERT_LE(of_killed, kMaxBytes);
  Child daemon(locusd(recording(robot, kMaxBytes)));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(robot));
  ASSERT_TRUE(daemon.wait_for_line("recording to")) << testing::PrintToString(daemon.lines());
  std::uint64_t most_bytes = 0;
  EXPECT_TRUE(comes_true([&] {
    most_bytes = std::max(most_bytes, bytes_in(file("record")));
    return !std::filesystem::exists(killed / "000001");
  })) << "it is the oldest";
  EXPECT_GT(bytes_in(runs().back()), (kMaxBytes - of_killed) / 4) << "it is kept as long as there is room";
  EXPECT_LE(most_bytes, kMaxBytes);
  EXPECT_GT(most_bytes, kMaxBytes * 3 / 4);
  EXPECT_TRUE(comes_true([&] { return bytes_in(runs().back()) > kMaxBytes * 7 / 10; }));
  EXPECT_LE(bytes_in(file("record")), kMaxBytes);
  EXPECT_EQ(status()["recording"]["problem"], "");
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait_for_exit(), 0);
  ASSERT_GE(runs().size(), 1U);
  EXPECT_TRUE(runs().back().filename().string().starts_with("000002_"));
  const Replay all({"--quiet", file("record").string()});
  EXPECT_EQ(all.run().status, 0) << all.run().err;
  EXPECT_GE(all.trajectory().size(), 30U);
}

TEST_F(Recording, FullDiskIsReportedOnceAndTheOdometryContinues) {
  if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
    GTEST_SKIP() << "no mounts of one's own: run as root, or allow user namespaces";
  const std::filesystem::path disk = file("disk");
  std::filesystem::create_directory(disk);
  ASSERT_EQ(mount("disk", disk.c_str(), "tmpfs", 0, "size=16m"), 0);
  const std::filesystem::path& robot = capture();
  Child daemon(locusd(recording(robot, 10'000'000, disk / "record")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  const Child play(endlessly(robot));
  ASSERT_TRUE(daemon.wait_for_line("recording to")) << testing::PrintToString(daemon.lines());
  {
    std::ofstream filler{disk / "filler"};
    while (filler << std::string(1 << 16, 'x') << std::flush) {
    }
  }
  ASSERT_TRUE(daemon.wait_for_line("error: "));
  const auto error_lines = [&] {
    std::vector<std::string> errors = daemon.lines();
    std::erase_if(errors, [](const std::string& line) { return line.find("error: ") == std::string::npos; });
    return errors;
  };
  EXPECT_NE(error_lines()[0].find("No space left on device"), std::string::npos) << error_lines()[0];
  EXPECT_NE(error_lines()[0].find("the odometry continues"), std::string::npos) << error_lines()[0];
  const int before = status()["sweeps"]["processed"];
  status_when(
      [&](const auto& now) { return now["sweeps"]["processed"] > before + 10 && now["recording"]["dropped"] > 0; });
  EXPECT_NE(ctl({"status"}).out.find("recording   none: "), std::string::npos) << ctl({"status"}).out;
  std::filesystem::remove(disk / "filler");
  EXPECT_TRUE(status_comes([](const auto& now) { return now["recording"]["problem"] == ""; }));
  const std::uint64_t left = bytes_in(disk / "record");
  EXPECT_TRUE(comes_true([&] { return bytes_in(disk / "record") > left + 1'000'000; })); // about one second
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait_for_exit(), 0);
  EXPECT_EQ(error_lines().size(), 1U) << testing::PrintToString(error_lines());
  const Replay replay({"--quiet", (disk / "record").string()});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_GT(replay.trajectory().size(), 5U);
  umount2(disk.c_str(), MNT_DETACH);
}

TEST_F(Recording, UnusableFolderIsReportedOnceAndTheOdometryContinues) {
  std::ofstream{file("plain")} << "a file";
  Child daemon(locusd(recording(capture(), 10'000'000, "plain/record")));
  ASSERT_TRUE(daemon.wait_for_line("DDS is up"));
  EXPECT_TRUE(daemon.wait_for_line("plain/record: cannot be created (Not a directory)"))
      << testing::PrintToString(daemon.lines());
  const Child play(endlessly(capture()));
  const nlohmann::json status = status_when(
      [](const auto& now) { return now["sweeps"]["processed"] > 10 && now["recording"]["dropped"] > 1000; });
  EXPECT_EQ(status["recording"]["recorded"], 0);
}

TEST_F(Recording, ReadOnlyDiskIsReportedBeforeAnyInput) {
  if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
    GTEST_SKIP() << "no mounts of one's own: run as root, or allow user namespaces";
  const std::filesystem::path disk = file("disk");
  std::filesystem::create_directory(disk);
  ASSERT_EQ(mount("disk", disk.c_str(), "tmpfs", MS_RDONLY, nullptr), 0);
  Child daemon(locusd(recording(capture(), 10'000'000, disk)));
  EXPECT_TRUE(daemon.wait_for_line("disk: cannot be written to (Read-only file system)"))
      << testing::PrintToString(daemon.lines());
  umount2(disk.c_str(), MNT_DETACH);
}

} // namespace
} // namespace locus::test
