// SPDX-License-Identifier: Apache-2.0
// Replay of folders with one point file per sweep, such as EuRoC's.
#include <algorithm>
#include <functional>
#include <limits>
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bag_writer.hpp"
#include "replay_run.hpp"
#include "support/clouds.hpp"
#include "support/errors.hpp"
#include "support/pcd_text.hpp"
#include "support/test_data.hpp"
#include "support/test_drives.hpp"
#include "sweep_folders.hpp"

namespace locus::test {
namespace {

using std::filesystem::path;

const std::string kNoSources = "motion_sources=[]";

/// Returns the clouds of the drive around the room without the initial standstill.
const std::vector<OwnCloud>& room_clouds(CloudKind kind = CloudKind::velodyne_start) {
  static std::map<CloudKind, std::vector<OwnCloud>> all;
  std::vector<OwnCloud>& clouds = all[kind];
  if (clouds.empty()) {
    constexpr std::size_t kStands = 35 * 76; // packets of the first three seconds
    for (const CloudTurn& turn : turns_of(room_drive() / "lidar.pcap", kStands))
      clouds.push_back(cloud_of(turn, kind));
  }
  return clouds;
}

std::string bin_of(const OwnCloud& cloud) {
  std::vector<float> numbers;
  for (std::size_t i = 0; i < cloud.width; ++i) {
    for (const char* const name : {"x", "y", "z", "intensity"})
      numbers.push_back(cloud.get<float>(i, name) * (name[0] == 'i' ? 1.0F / 255.0F : 1.0F));
  }
  return bytes_of_floats(numbers);
}

using Write = std::function<std::string(const OwnCloud&)>;

/// Writes a folder in EuRoC's layout: lidar0/data/STAMP.pcd.
void write_euroc(const path& folder, const Write& text_of, const std::string& extension = "pcd",
                 CloudKind kind = CloudKind::velodyne_start) {
  for (const OwnCloud& cloud : room_clouds(kind))
    write_with_folders(folder / fmt::format("lidar0/data/{}.{}", to_ns(cloud.stamp), extension), text_of(cloud));
}

std::string in_order(const path& folder, const Write& text_of, const std::string& extension) {
  std::size_t number = 0;
  for (const OwnCloud& cloud : room_clouds())
    write_with_folders(folder / fmt::format("{}.{}", number++, extension), text_of(cloud));
  return folder;
}

/// Returns the time of each sweep in this unit.
std::string times_in(const std::string& unit, Duration later = {}) {
  std::string text;
  for (const OwnCloud& cloud : room_clouds()) {
    const std::int64_t ns = to_ns(cloud.stamp + later);
    if (unit == "s")
      text += fmt::format("{}.{:09}\n", ns / 1'000'000'000, ns % 1'000'000'000);
    else if (unit == "us")
      text += fmt::format("{}.{:03}\n", ns / 1000, ns % 1000);
    else
      text += fmt::format("{}\n", ns);
  }
  return text;
}

TEST(EurocFolder, PcdOfEveryEncodingGivesTheBitsOfABagWithTheSameClouds) {
  const TemporaryFolder folder;
  write_euroc(folder / "ascii", pcd_as_text);
  write_euroc(folder / "binary", pcd_as_binary);
  write_euroc(folder / "compressed", pcd_compressed);
  std::vector<Stamp> ends;
  for (const OwnCloud& cloud : room_clouds())
    ends.push_back(cloud.stamp + std::chrono::milliseconds{100});
  write_with_folders(folder / "clouds.bag", ros1_bag(messages_of(room_drive(), room_clouds(), ends, RosVersion::ros1)));
  const Replay bag({"--set", kNoSources, folder / "clouds.bag"});
  const std::string expected = read_text(bag.file("odometry.tum"));
  EXPECT_GT(lines_of(expected).size(), 40U);
  for (const char* const name : {"ascii", "binary", "compressed"}) {
    const Replay replay({"--set", kNoSources, folder / name});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    EXPECT_EQ(replay.run().err, "");
    EXPECT_EQ(read_text(replay.file("odometry.tum")), expected) << name;
    EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["times"], "field");
    EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["rings"], "field");
    EXPECT_TRUE(contains(replay.run().out, "data is lidar front")) << replay.run().out;
  }
}

TEST(EurocFolder, FieldsOfDriversAreReadAsInMessages) {
  for (const CloudKind kind : {CloudKind::ouster, CloudKind::hesai, CloudKind::nebula}) {
    const TemporaryFolder folder;
    write_euroc(folder.path(), pcd_as_binary, "pcd", kind);
    const Replay replay({"--set", kNoSources, folder.path()});
    ASSERT_EQ(replay.run().status, 0) << replay.run().err;
    EXPECT_EQ(replay.run().err, "") << name_of(kind);
    EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["times"], "field") << name_of(kind);
  }
}

TEST(EurocFolder, ImuAndTruthBesideTheLidarAreUsed) {
  const TemporaryFolder folder;
  write_euroc(folder / "mav0", pcd_as_binary);
  write_with_folders(folder / "mav0/imu0/data.csv",
                     "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n" + read_text(room_drive() / "imu.csv"));
  std::string truth = "#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z, v_x\n";
  for (const StampedPose& pose : read_tum(room_drive() / "gt.tum")) {
    const Eigen::Vector3d& p = pose.T_source_base.translation;
    const Eigen::Quaterniond& q = pose.T_source_base.rotation;
    truth +=
        fmt::format("{},{},{},{},{},{},{},{},0\n", to_ns(pose.stamp), p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
  }
  write_with_folders(folder / "mav0/state_groundtruth_estimate0/data.csv", truth);
  const std::vector<std::string> mounted{"--set", "lidars.0.T_base_lidar.xyz_m=[0.3,0,0.75]"};
  const Replay replay({mounted[0], mounted[1], folder / "mav0"});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().out, "imu0/data.csv is imu, the estimated states are the truth"))
      << replay.run().out;
  EXPECT_GT(replay.summary()["sources"]["imu"]["used_sweeps"], 30);
  EXPECT_LT(replay.summary()["ape_m"]["mean"], 0.03) << "ranges are off by 1 cm";
  const Replay above({mounted[0], mounted[1], folder.path()});
  EXPECT_EQ(read_text(above.file("odometry.tum")), read_text(replay.file("odometry.tum")));
  EXPECT_TRUE(contains(above.run().out, "the only recording in it is used, " + (folder / "mav0").string()))
      << above.run().out;
  const Replay alone({mounted[0], mounted[1], folder / "mav0/lidar0"});
  EXPECT_EQ(read_text(alone.file("odometry.tum")), read_text(replay.file("odometry.tum"))) << "imu0 lies beside it";
}

TEST(SweepFolder, BinHasTheTrajectoryOfPcdWithoutTimes) {
  const TemporaryFolder folder;
  in_order(folder / "bin", bin_of, "bin");
  write_with_folders(folder / "bin/times.txt", times_in("s"));
  const auto bare = [](const OwnCloud& cloud) {
    OwnCloud without = cloud;
    remove_field(without, "time");
    remove_field(without, "ring");
    return pcd_as_binary(without);
  };
  in_order(folder / "pcd", bare, "pcd");
  write_with_folders(folder / "pcd/times.txt", times_in("s"));
  const Replay bin({"--set", kNoSources, folder / "bin"}), pcd({"--set", kNoSources, folder / "pcd"});
  ASSERT_EQ(bin.run().status, 0) << bin.run().err;
  EXPECT_EQ(read_text(bin.file("odometry.tum")), read_text(pcd.file("odometry.tum")));
  EXPECT_EQ(bin.summary()["lidars"]["front"]["clouds"]["times"], "azimuth");
  EXPECT_TRUE(contains(bin.run().err, "have no field of times")) << bin.run().err;
}

TEST(SweepFolder, TimesAreReadInAnyUnitAndFromAnyTable) {
  const TemporaryFolder folder;
  in_order(folder / "drive", pcd_as_binary, "pcd");
  const auto odometry_with = [&](const std::string& table, const std::string& text) {
    write_with_folders(folder / "drive" / table, text);
    const Replay replay({"--set", kNoSources, folder / "drive"});
    EXPECT_EQ(replay.run().status, 0) << replay.run().err;
    std::filesystem::remove(folder / "drive" / table);
    return read_text(replay.file("odometry.tum"));
  };
  const std::string expected = odometry_with("times.txt", times_in("ns"));
  EXPECT_EQ(odometry_with("timestamps.txt", times_in("s")), expected);
  EXPECT_EQ(odometry_with("../times.txt", times_in("s")), expected) << "above their folder";
  EXPECT_EQ(odometry_with("times.txt", "# of the lidar\n\n" + times_in("us") + "\n"), expected);
  std::string table = "timestamp,filename\r\n";
  const std::vector<std::string> times = lines_of(times_in("ns"));
  for (std::size_t i = 0; i < times.size(); ++i)
    table += fmt::format("{},{}.pcd\r\n", times[i], i);
  EXPECT_EQ(odometry_with("data.csv", table), expected);
}

TEST(SweepFolder, WrongTimesAreNamedWithFileAndLine) {
  const TemporaryFolder folder;
  const path drive = in_order(folder / "drive", pcd_as_binary, "pcd");
  std::vector<std::string> times = lines_of(times_in("ns"));
  const auto expect_refused_with = [&](const std::vector<std::string>& lines, const std::vector<std::string>& said) {
    write_with_folders(drive / "times.txt", fmt::format("{}\n", fmt::join(lines, "\n")));
    expect_refused(drive, said);
  };
  expect_refused(drive, {drive.string(), "neither are the names of its sweeps times (0.pcd)", "add one"});
  std::vector<std::string> fewer = times, swapped = times, twice = times, words = times, nan = times;
  fewer.pop_back();
  std::swap(swapped[5], swapped[6]);
  twice[7] = twice[6];
  words[9] = "noon";
  nan[9] = "nan";
  expect_refused_with(fewer, {"times.txt", fmt::format("{} times for {} sweeps", fewer.size(), times.size())});
  expect_refused_with(swapped, {"times.txt:7", "is before the time before it"});
  expect_refused_with(twice, {"times.txt:8", "is equal to the time before it"});
  expect_refused_with(words, {"times.txt:10", "noon is not a time"});
  expect_refused_with(nan, {"times.txt:10", "nan is not a time"});
  std::vector<std::string> numbers;
  for (std::size_t i = 0; i < times.size(); ++i)
    numbers.push_back(fmt::format("{:.4f}", 1e-4 * static_cast<double>(i)));
  expect_refused_with(numbers, {"times.txt:1", "in no unit"});
  write_with_folders(drive / "times.txt", "");
  expect_refused(drive, {"0 times for"});
  std::filesystem::remove(drive / "times.txt");
  write_with_folders(drive / "data.csv", fmt::format("{}, gone.pcd\n", fmt::join(times, ", gone.pcd\n")));
  expect_refused(drive, {"data.csv:1", "there is no", "gone.pcd"});
}

/// KITTI's raw data numbers its sweeps with ten digits, as many as seconds since 1970 have.
TEST(SweepFolder, TenDigitNumbersAreNotTimes) {
  const TemporaryFolder folder;
  for (std::size_t i = 0; i < 3; ++i)
    write_with_folders(folder / fmt::format("data/{:010}.pcd", i), pcd_as_binary(room_clouds()[i]));
  expect_refused(folder / "data", {"neither are the names of its sweeps times (0000000000.pcd)"});
}

TEST(SweepFolder, EmptyFolderIsReported) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "drive/lidar0/data");
  expect_refused(folder / "drive", {"drive/lidar0/data: contains no sweep"});
}

TEST(SweepFolder, UnreadableSweepsAreSkippedAndTheFirstIsNamed) {
  const TemporaryFolder folder;
  const path drive = in_order(folder / "drive", bin_of, "bin");
  write_with_folders(drive / "times.txt", times_in("s"));
  std::filesystem::resize_file(drive / "7.bin", 12'345);
  std::filesystem::resize_file(drive / "9.bin", 0);
  const Replay replay({"--set", kNoSources, drive});
  EXPECT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_TRUE(contains(replay.run().err, "7.bin: 12345 bytes are not whole points of 16")) << replay.run().err;
  EXPECT_TRUE(
      contains(replay.run().err, fmt::format("2 of {} sweeps cannot be read and are skipped", room_clouds().size())));
  EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["received"], room_clouds().size() - 2);
  for (std::size_t i = 0; i < room_clouds().size(); ++i)
    std::filesystem::resize_file(drive / fmt::format("{}.bin", i), 17);
  const Replay none({drive});
  EXPECT_EQ(none.run().status, 1);
  EXPECT_TRUE(contains(none.run().err, "0.bin: 17 bytes are not whole points of 16")) << none.run().err;
}

TEST(SweepFolder, InvalidPointsAreCountedAndDropped) {
  const TemporaryFolder folder;
  const auto spoilt = [](const OwnCloud& cloud) {
    OwnCloud copy = cloud;
    for (std::size_t i = 0; i < 50; ++i)
      copy.set(7 * i, "x", std::numeric_limits<float>::quiet_NaN());
    return pcd_as_text(copy);
  };
  write_euroc(folder.path(), spoilt);
  const Replay replay({"--set", kNoSources, folder.path()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.summary()["lidars"]["front"]["clouds"]["nan"], 50 * room_clouds().size());
}

TEST(SweepFolder, WrittenSweepsAreReplayedUnchanged) {
  const TemporaryFolder folder;
  const path sweeps = folder / "out/sweeps";
  const Replay first({"--sweeps", sweeps, "--set", kNoSources, room_drive()});
  const Replay again({"--set", kNoSources, "--set", "lidars.0.point_times=none", sweeps});
  ASSERT_EQ(again.run().status, 0) << again.run().err;
  const std::vector<StampedPose> a = first.trajectory(), b = again.trajectory();
  ASSERT_GE(a.size(), b.size());
  ASSERT_GT(b.size() + 3, a.size());
  EXPECT_LT((a.back().T_source_base.translation - b.back().T_source_base.translation).norm(), 0.05);
}

/// Points of one instant have their neighbours on the rings above and below as well: without these, no normals, and the
/// robot stays behind by metres.
TEST(SweepFolder, SweepsOfOneInstantAreTrackedInClutter) {
  const path drive = test_data() / "trial/people";
  if (!std::filesystem::exists(drive))
    GTEST_SKIP() << drive << " is not here; set LOCUS_TEST_DATA";
  const TemporaryFolder folder;
  const path sweeps = folder / "out/sweeps";
  const Replay first(
      {"--duration", "8", "--sweeps", sweeps, "--set", kNoSources, "-c", drive / "config.yaml", drive / "lidar.pcap"});
  const Replay again({"--set", kNoSources, "--set", "lidars.0.point_times=none", sweeps});
  ASSERT_EQ(again.run().status, 0) << again.run().err;
  const std::vector<StampedPose> a = first.trajectory(), b = again.trajectory();
  EXPECT_GT(a.back().T_source_base.translation.norm(), 4);
  EXPECT_LT((a.back().T_source_base.translation - b.back().T_source_base.translation).norm(), 0.05);
}

TEST(SweepFolder, IsNotOverwrittenByResults) {
  const TemporaryFolder folder;
  const path drive = in_order(folder / "drive", bin_of, "bin");
  write_with_folders(drive / "times.txt", times_in("s"));
  const ProgramRun results = run_program(LOCUS_REPLAY, {"-o", drive, drive});
  EXPECT_EQ(results.status, 2);
  EXPECT_TRUE(contains(results.err, "contains a recording")) << results.err;
  const ProgramRun sweeps = run_program(LOCUS_REPLAY, {"-o", folder / "out", "--sweeps", drive / "sweeps", drive});
  EXPECT_EQ(sweeps.status, 2);
  EXPECT_TRUE(contains(sweeps.err, "the recording that is read")) << sweeps.err;
}

} // namespace
} // namespace locus::test
