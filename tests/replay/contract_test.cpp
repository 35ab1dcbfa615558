// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;

std::uint64_t sum(const json& counters) {
  std::uint64_t total = 0;
  for (const auto& [name, count] : counters.items())
    total += count.get<std::uint64_t>();
  return total;
}

void expect_packets_add_up(const json& packets) {
  EXPECT_EQ(packets["received"].get<std::uint64_t>(),
            packets["data"].get<std::uint64_t>() + packets["position"].get<std::uint64_t>() + sum(packets["rejected"]));
}

void expect_sweeps_add_up(const json& sweeps) {
  EXPECT_EQ(sweeps["seen"].get<std::uint64_t>(), sweeps["processed"].get<std::uint64_t>() +
                                                     sweeps["dropped"].get<std::uint64_t>() +
                                                     sweeps["failed"].get<std::uint64_t>());
}

std::set<std::string> keys(const json& object) {
  std::set<std::string> names;
  for (const auto& [name, value] : object.items())
    names.insert(name);
  return names;
}

TEST(LocusReplay, OneRowForEverySweepInBothTables) {
  const Replay replay({room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  const auto trajectory = replay.trajectory();
  const auto table = replay.table();
  const json sweeps = replay.summary()["sweeps"];
  ASSERT_EQ(trajectory.size(), sweeps["seen"].get<std::size_t>() - sweeps["dropped"].get<std::size_t>());
  EXPECT_NEAR(static_cast<double>(trajectory.size()), 80, 2);
  ASSERT_EQ(table.size(), trajectory.size() + 1) << "a header line comes first";

  const std::set<std::string> states{"tracking", "degenerate", "dead_reckoning", "standstill"};
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const std::vector<std::string>& row = table[i + 1];
    ASSERT_EQ(row.size(), 5U + 36U + 2U * 14U);
    EXPECT_EQ(row[0], std::to_string(to_ns(trajectory[i].stamp)));
    EXPECT_TRUE(states.contains(row[1])) << row[1];
    EXPECT_EQ(row[2], i == 0 ? "identity" : "imu+wio");
    for (std::size_t axis = 0; axis < 6; ++axis)
      EXPECT_GE(std::stod(row[5 + 7 * axis]), 0.0) << "variances of row " << i;
    EXPECT_NEAR(trajectory[i].T_source_base.rotation.norm(), 1.0, 1e-9);
  }
}

TEST(LocusReplay, EachSourceIsComparedWithAllOthers) {
  const Replay replay({"--fail", "wio:lost@4", room_drive().string()});
  const auto table = replay.table();
  const auto column = [&](const std::string& name) {
    const auto found = std::ranges::find(table.front(), name);
    EXPECT_NE(found, table.front().end()) << name;
    return static_cast<std::size_t>(found - table.front().begin());
  };
  for (const char* const source : {"wio", "imu"}) {
    const std::string name = source;
    const std::size_t x = column(name + "_innovation_x"), sd_x = column(name + "_sd_x"),
                      sd_yaw = column(name + "_sd_yaw"), ratio = column(name + "_test_ratio"),
                      used = column(name + "_last_used_ns");
    EXPECT_EQ(table[1][used], "0") << "the first sweep has no prior";
    const std::vector<std::string>& amid = table[31];
    EXPECT_EQ(std::stod(amid[sd_x]) > 0.0, name == "wio") << "an IMU measures no translation";
    EXPECT_LT(std::abs(std::stod(amid[x])), 0.1);
    EXPECT_GT(std::stod(amid[sd_yaw]), 1e-4);
    EXPECT_GT(std::stod(amid[ratio]), 0.0);
    EXPECT_LT(std::stod(amid[ratio]), 1.0) << "consistent source";
    EXPECT_EQ(amid[used], amid[0]);
    EXPECT_EQ(table.back()[used] == table.back()[0], name == "imu") << "the wheels are lost by then";
  }
}

TEST(LocusReplay, FirstRowIsTheOriginWithoutYaw) {
  const Replay replay({room_drive().string()});
  const auto trajectory = replay.trajectory();
  ASSERT_FALSE(trajectory.empty()) << replay.run().err;
  EXPECT_TRUE(trajectory.front().T_source_base.translation.isZero());
  EXPECT_NEAR(to_rpy_rad(trajectory.front().T_source_base.rotation).z(), 0.0, 1e-12);
}

TEST(LocusReplay, SummaryHasTheKeysOfTheContract) {
  const Replay replay({room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json summary = replay.summary();
  EXPECT_EQ(keys(summary), (std::set<std::string>{"version",
                                                  "capture",
                                                  "config_sha256",
                                                  "threads",
                                                  "isa",
                                                  "duration_s",
                                                  "wall_s",
                                                  "cpu_s",
                                                  "peak_rss_mb",
                                                  "packets",
                                                  "lidars",
                                                  "sweeps",
                                                  "trajectory_digest",
                                                  "process_ms",
                                                  "process_cpu_ms",
                                                  "stage_ms",
                                                  "points",
                                                  "iterations_mean",
                                                  "largest_speed_mps",
                                                  "sources",
                                                  "ape_m",
                                                  "rpe_10m_percent",
                                                  "end_drift_m",
                                                  "covariance"}))
      << "the folder has the true poses, but not the map";
  EXPECT_EQ(keys(summary["ape_m"]), (std::set<std::string>{"max", "mean", "std", "rmse"}));
  const std::set<std::string> percentiles{"p50", "p90", "p99", "max"};
  EXPECT_EQ(keys(summary["process_ms"]), percentiles);
  EXPECT_EQ(keys(summary["process_cpu_ms"]), percentiles);
  EXPECT_EQ(keys(summary["stage_ms"]), (std::set<std::string>{"decode", "correct", "filter", "covariance",
                                                              "scan_to_scan", "scan_to_submap", "map"}));
  EXPECT_EQ(keys(summary["points"]), (std::set<std::string>{"raw_mean", "filtered_mean"}));
  EXPECT_EQ(keys(summary["iterations_mean"]), (std::set<std::string>{"scan_to_scan", "scan_to_submap"}));
  EXPECT_EQ(keys(summary["packets"]), (std::set<std::string>{"total", "front"}));
  EXPECT_EQ(keys(summary["packets"]["front"]),
            (std::set<std::string>{"received", "data", "position", "lost", "reordered", "clock_steps", "rejected"}));
  EXPECT_EQ(keys(summary["packets"]["front"]["rejected"]),
            (std::set<std::string>{"length", "flag", "model", "sender", "azimuth", "time", "duplicate", "truncated",
                                   "checksum"}));
  EXPECT_EQ(summary["lidars"]["front"]["model"], "VLP-16");
  EXPECT_EQ(summary["lidars"]["front"]["return_mode"], "strongest");
  EXPECT_NEAR(summary["lidars"]["front"]["rpm"].get<double>(), 600, 5);
  EXPECT_EQ(keys(summary["sources"]), (std::set<std::string>{"wio", "imu"}));
  EXPECT_EQ(keys(summary["sources"]["imu"]), (std::set<std::string>{"received", "used_sweeps", "largest_test_ratio",
                                                                    "rejected", "health_changes", "learned"}));
  EXPECT_EQ(keys(summary["sources"]["imu"]["rejected"]),
            (std::set<std::string>{"stale", "jump", "nan", "frozen", "out_of_order", "covariance", "disagreement"}));

  EXPECT_EQ(summary["capture"], room_drive().string());
  EXPECT_EQ(summary["config_sha256"].get<std::string>().size(), 64U);
  EXPECT_NEAR(summary["duration_s"].get<double>(), 8.0, 0.01);
  EXPECT_LT(summary["peak_rss_mb"].get<double>(), 200.0);
  EXPECT_GT(summary["cpu_s"].get<double>(), 0.0);
  EXPECT_GT(summary["process_ms"]["p50"].get<double>(), 0.0);
  EXPECT_LE(summary["process_ms"]["p50"].get<double>(), summary["process_ms"]["max"].get<double>());
  EXPECT_GT(summary["points"]["raw_mean"].get<double>(), summary["points"]["filtered_mean"].get<double>());
  EXPECT_NEAR(summary["sources"]["imu"]["received"].get<int>(), 1600, 1);
  EXPECT_EQ(summary["sources"]["wio"]["used_sweeps"], summary["sweeps"]["seen"].get<int>() - 1);
}

TEST(LocusReplay, MapIsABinaryPcdOfTheSizeItStates) {
  const Replay replay({room_drive().string()});
  const std::string map = read_text(replay.file("map.pcd"));
  const std::size_t data = map.find("DATA binary\n");
  const std::size_t points = map.find("POINTS ");
  ASSERT_NE(data, std::string::npos);
  ASSERT_NE(points, std::string::npos);
  const std::size_t count = std::stoul(map.substr(points + 7));
  EXPECT_GT(count, 100U);
  EXPECT_EQ(map.size(), data + 12 + count * 6 * sizeof(float));
}

TEST(LocusReplay, ReportShowsTheRunAgainstTheTruthOfTheFolder) {
  const Replay replay({room_drive().string()});
  const std::string page = read_text(replay.file("report.html"));
  const std::string begin = R"(<script type="application/json" id="run">)";
  const std::size_t first = page.find(begin) + begin.size();
  const json run = json::parse(page.substr(first, page.find("</script>", first) - first));
  EXPECT_EQ(run["summary"], replay.summary());
  EXPECT_EQ(run["path"]["t"].size(), run["path"]["x"].size());
  EXPECT_GT(run["path"]["t"].size(), 50U);
  EXPECT_GT(run["truth"]["t"].size(), 50U);
  EXPECT_GT(run["map"]["count"], 100);
  EXPECT_EQ(run["health"].back()["name"], "imu");
}

TEST(LocusReplay, SameBytesForEveryNumberOfThreadsAndOnEveryRun) {
  const std::string capture = room_drive().string();
  const std::string expected = read_text(Replay({"--threads", "1", capture}).file("odometry.tum"));
  ASSERT_FALSE(expected.empty());
  for (const char* threads : {"1", "2", "2", "4", "4"}) {
    const Replay replay({"--threads", threads, capture});
    EXPECT_EQ(read_text(replay.file("odometry.tum")), expected) << threads << " threads";
    EXPECT_EQ(replay.run().err, "") << threads << " threads, however few processors";
  }
}

TEST(LocusReplay, StaysWithinThreeCentimetresOfTruthInARoom) {
  const Replay replay({room_drive().string()});
  const json error = replay.summary()["ape_m"];
  EXPECT_LT(error["rmse"].get<double>(), 0.015);
  EXPECT_LT(error["max"].get<double>(), 0.03);
}

TEST(LocusReplay, FilesNamedOneByOneEqualTheFolder) {
  const std::string folder = room_drive().string();
  const Replay whole({folder});
  const Replay named({"-c", folder + "/config.yaml", "--imu", folder + "/imu.csv", "--odometry",
                      "wio=" + folder + "/wio.tum", folder + "/lidar.pcap"});
  ASSERT_EQ(named.run().status, 0) << named.run().err;
  EXPECT_EQ(read_text(named.file("odometry.tum")), read_text(whole.file("odometry.tum")));
}

TEST(LocusReplay, BareFolderWithoutConfigurationUsesItsMotionFilesByTheirNames) {
  const TemporaryFolder folder;
  for (const char* name : {"lidar.pcap", "imu.csv", "wio.tum"})
    std::filesystem::copy(room_drive() / name, folder / name);
  const Replay replay({folder.path().string()});
  ASSERT_EQ(replay.run().status, 0);
  EXPECT_EQ(replay.run().err, "");
  EXPECT_GT(replay.summary()["sources"]["wio"]["used_sweeps"].get<int>(), 70);
  EXPECT_GT(replay.summary()["sources"]["imu"]["used_sweeps"].get<int>(), 70);
}

TEST(LocusReplay, BareFolderOfAWalkingRobotUsesItsMotionFilesToo) {
  const TemporaryFolder folder;
  for (const char* name : {"lidar.pcap", "imu.csv"})
    std::filesystem::copy(room_drive() / name, folder / name);
  for (const char* name : {"vio.tum", "kio.tum"})
    std::filesystem::copy(room_drive() / "wio.tum", folder / name);
  const Replay replay({"--set", "motion_sources.imu.T_base_source.xyz_m=[0, 0, 0]", folder.path().string()});
  ASSERT_EQ(replay.run().status, 0);
  EXPECT_EQ(replay.run().err, "");
  EXPECT_GT(replay.summary()["sources"]["vio"]["used_sweeps"].get<int>(), 70) << "it stands before kio";
  EXPECT_GT(replay.summary()["sources"]["kio"]["received"].get<int>(), 70);
}

TEST(LocusReplay, BareCaptureRunsOnLidarAloneWithoutNoise) {
  const Replay replay({(room_drive() / "lidar.pcap").string()});
  ASSERT_EQ(replay.run().status, 0);
  EXPECT_EQ(replay.run().err, "");
  EXPECT_EQ(replay.table().at(2).at(2), "constant_velocity");
}

TEST(LocusReplay, StartAndDurationCutTheRecording) {
  const Replay whole({room_drive().string()});
  const Replay part({"--start", "2", "--duration", "3", room_drive().string()});
  ASSERT_EQ(part.run().status, 0) << part.run().err;
  EXPECT_NEAR(static_cast<double>(part.trajectory().size()), 30, 1);
  const Duration offset = part.trajectory().front().stamp - whole.trajectory().front().stamp;
  EXPECT_NEAR(to_seconds(offset), 2.0, 0.01);
  EXPECT_NEAR(part.summary()["duration_s"].get<double>(), 3.0, 0.01);
}

TEST(LocusReplay, LostLidarsAreBridgedByDeadReckoning) {
  const Replay replay({"--fail", "all-lidars:lost@2-5", room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const auto trajectory = replay.trajectory();
  const auto table = replay.table();
  ASSERT_NEAR(static_cast<double>(trajectory.size()), 80, 2);
  int dead_reckoned = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    EXPECT_LT(trajectory[i].stamp - trajectory[i - 1].stamp, milliseconds{110}) << "a gap at row " << i;
    dead_reckoned += table[i + 1][1] == "dead_reckoning" ? 1 : 0;
  }
  EXPECT_NEAR(dead_reckoned, 29, 2);
  EXPECT_EQ(table.back()[1], "tracking") << "registration resumes with the lidar";
  expect_sweeps_add_up(replay.summary()["sweeps"]);
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.1);
}

TEST(LocusReplay, RowsContinueToTheEndWithoutLidar) {
  const Replay replay({"--fail", "front:lost@4", (room_drive() / "lidar.pcap").string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_NEAR(static_cast<double>(replay.trajectory().size()), 80, 2);
}

TEST(LocusReplay, CountersAddUpUnderFaults) {
  const Replay replay({"--fail", "front:packet-loss=5@0", "--fail", "front:duplicate=5@0", "--fail",
                       "front:reorder=5@0", "--fail", "imu:nan@1-2", "--fail", "wio:duplicate=20@0",
                       room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json summary = replay.summary();
  expect_packets_add_up(summary["packets"]["total"]);
  expect_packets_add_up(summary["packets"]["front"]);
  expect_sweeps_add_up(summary["sweeps"]);
  EXPECT_GT(summary["packets"]["total"]["rejected"]["duplicate"], 0);
  EXPECT_GT(summary["packets"]["total"]["lost"], 0);
  EXPECT_GT(summary["packets"]["total"]["reordered"], 0);
  EXPECT_EQ(summary["sources"]["imu"]["rejected"]["nan"], 200);
  EXPECT_GT(summary["sources"]["wio"]["rejected"]["out_of_order"], 0);
}

TEST(LocusReplay, TwoLidarsGiveOneTrajectory) {
  const TemporaryFolder folder;
  write_room_drive(folder.path(), std::chrono::seconds{4}, 2);
  const Replay replay({folder.path().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json packets = replay.summary()["packets"];
  EXPECT_EQ(keys(packets), (std::set<std::string>{"total", "front", "rear"}));
  EXPECT_EQ(packets["total"]["data"].get<int>(),
            packets["front"]["data"].get<int>() + packets["rear"]["data"].get<int>());
  EXPECT_GT(packets["rear"]["data"].get<int>(), 2900);
  EXPECT_NEAR(static_cast<double>(replay.trajectory().size()), 40, 1);
  EXPECT_LT(replay.summary()["ape_m"]["max"].get<double>(), 0.03);
}

TEST(LocusReplay, RealtimeTakesAsLongAsTheRecordingAndCountsEverything) {
  const Replay replay({"--realtime=2", "--duration", "4", room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json summary = replay.summary();
  expect_sweeps_add_up(summary["sweeps"]);
  expect_packets_add_up(summary["packets"]["total"]);
  EXPECT_NEAR(summary["sweeps"]["seen"].get<int>(), 40, 1);
  EXPECT_EQ(replay.trajectory().size(),
            summary["sweeps"]["seen"].get<std::size_t>() - summary["sweeps"]["dropped"].get<std::size_t>());
  EXPECT_GT(summary["wall_s"].get<double>(), 1.9);
}

TEST(LocusReplay, RealtimeMayBeSlowedDown) {
  const Replay replay({"--realtime=0.5", "--duration", "1", room_drive().string()});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_GT(replay.summary()["wall_s"], 1.7);
}

TEST(LocusReplay, LidarsArePrintedWithModelModeAndRate) {
  const std::string told = Replay({"--duration", "2", room_drive().string()}).run().out;
  EXPECT_NE(told.find("\nfront      VLP-16, strongest returns, 600 rpm\n"), std::string::npos) << told;
}

TEST(LocusReplay, LastLineIdentifiesTheRun) {
  const Replay replay({"--threads", "1", room_drive().string()});
  const json summary = replay.summary();
  const std::string line = lines_of(replay.run().out).back();
  EXPECT_TRUE(line.starts_with("run        80 sweeps: 0 dropped, 0 failed, 0 dead reckoned, 0 without a source;"))
      << line;
  EXPECT_TRUE(line.ends_with("; trajectory " + summary["trajectory_digest"].get<std::string>())) << line;
  EXPECT_EQ(lines_of(Replay({"--threads", "4", room_drive().string()}).run().out).back(), line);
  const Replay jump({"--fail", "wio:jump=1@4", room_drive().string()});
  EXPECT_NE(jump.summary()["trajectory_digest"], summary["trajectory_digest"]);
  EXPECT_GT(jump.summary()["sources"]["wio"]["largest_test_ratio"], summary["sources"]["wio"]["largest_test_ratio"]);

  const json blind = Replay({"--fail", "all-lidars:lost@4-6", "--fail", "wio:lost@4-6", "--fail", "imu:lost@4-6",
                             room_drive().string()})
                         .summary()["sweeps"];
  EXPECT_NEAR(blind["dead_reckoned"].get<int>(), 20, 2);
  EXPECT_NEAR(blind["without_source"].get<int>(), 30, 2) << "sources that return stay on probation for a second";
}

TEST(LocusReplay, FiguresGoToStdoutUnlessQuiet) {
  EXPECT_NE(Replay({room_drive().string()}).run().out.find("sweeps"), std::string::npos);
  const Replay quiet({"--quiet", room_drive().string()});
  EXPECT_EQ(quiet.run().out + quiet.run().err, "");
  EXPECT_EQ(quiet.run().status, 0);
}

TEST(LocusReplay, OverridesTakeEffectAndAreInTheSummary) {
  const Replay plain({room_drive().string()});
  const Replay changed({"--set", "sweep_period_ms=200", "--set", "lidars.front.time=receive", room_drive().string()});
  EXPECT_NEAR(static_cast<double>(changed.trajectory().size()), 40, 1);
  EXPECT_NE(changed.summary()["config_sha256"], plain.summary()["config_sha256"]);
}

TEST(LocusReplay, HelpHasAnExampleAndVersionIsPrinted) {
  const ProgramRun help = run_program(LOCUS_REPLAY, {"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_NE(help.out.find("locus-replay -o out drive.pcap"), std::string::npos);
  const ProgramRun version = run_program(LOCUS_REPLAY, {"--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_EQ(version.out.rfind("locus-replay ", 0), 0U) << version.out;
}

} // namespace
} // namespace locus::test
