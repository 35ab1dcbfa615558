// SPDX-License-Identifier: Apache-2.0
// Runs the real locus-sim, and the real locus-replay on its output.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <sys/resource.h>

#include "drivers/files/capture.hpp"
#include "drivers/velodyne/position_packet.hpp"
#include "locus_sim/imperfections.hpp"
#include "locus_sim/stream_sink.hpp"
#include "replay/replay_run.hpp"

namespace locus::test {
namespace {

std::vector<std::string> husky_in(const std::string& world, const std::string& folder,
                                  std::vector<std::string> more = {}) {
  std::vector<std::string> all{"--world", world, "--robot", "husky", "--duration", "12", "-o", folder};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

const std::vector<std::string> kFiles{"lidar.pcap", "imu.csv", "wio.tum", "gt.tum", "gt_map.ply", "config.yaml"};

TEST(LocusSim, SameOptionsGiveTheSameBytesAndAnotherSeedDoesNot) {
  const TemporaryFolder folder;
  const auto simulate = [&](const std::string& name, const std::string& seed) {
    const ProgramRun run = run_program(LOCUS_SIM, husky_in("urban", folder / name, {"--seed", seed, "--dust", "0.05"}));
    ASSERT_EQ(run.status, 0) << run.err;
  };
  simulate("a", "7");
  simulate("b", "7");
  simulate("c", "8");
  for (const std::string& file : kFiles) {
    const std::string bytes = read_text(folder / ("a/" + file));
    EXPECT_FALSE(bytes.empty()) << file;
    EXPECT_TRUE(bytes == read_text(folder / ("b/" + file))) << file;
    EXPECT_FALSE(bytes == read_text(folder / ("c/" + file))) << file; // the robot's parts in view differ, too
  }
}

TEST(LocusSim, FolderReplays) {
  const TemporaryFolder folder;
  const std::string capture = folder / "capture";
  ASSERT_EQ(run_program(LOCUS_SIM, husky_in("stairs", capture, {"--lidars", "3", "--realism", "clean"})).status, 0);
  const Replay replay({capture});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  const nlohmann::json summary = replay.summary();
  EXPECT_EQ(summary["packets"]["total"]["lost"], 0);
  EXPECT_EQ(summary["packets"]["total"]["clock_steps"], 0);
  EXPECT_EQ(summary["packets"].size(), 4U); // total, top, front, rear
  EXPECT_EQ(summary["sweeps"]["processed"], summary["sweeps"]["seen"]);
  EXPECT_LT(summary["ape_m"]["max"], 0.2);
}

struct OtherLidar {
  std::string model, robot, imu; ///< name of the source
};

class LocusSimWith : public testing::TestWithParam<OtherLidar> {};

INSTANTIATE_TEST_SUITE_P(OtherMakers, LocusSimWith,
                         testing::Values(OtherLidar{"OS1-32", "husky", "top_imu"},
                                         OtherLidar{"OS1-32", "handheld", "top_imu"}, // without odometry
                                         OtherLidar{"XT32", "husky", "imu"}),
                         [](const auto& test) { return test.param.robot + "_" + test.param.model.substr(0, 3); });

/// Same accuracy as with a Velodyne.
TEST_P(LocusSimWith, FolderReplays) {
  const TemporaryFolder folder;
  const std::string capture = folder / "capture";
  const ProgramRun run = run_program(LOCUS_SIM, {"--world", "stairs", "--robot", GetParam().robot, "--duration", "12",
                                                 "--model", GetParam().model, "--realism", "clean", "-o", capture});
  ASSERT_EQ(run.status, 0) << run.err;
  const Replay replay({capture});
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  EXPECT_EQ(replay.run().err, "");
  const nlohmann::json summary = replay.summary();
  EXPECT_EQ(summary["lidars"]["top"]["model"], GetParam().model);
  EXPECT_EQ(summary["packets"]["total"]["lost"], 0);
  for (const auto& [reason, packets] : summary["packets"]["total"]["rejected"].items())
    EXPECT_EQ(packets, 0) << reason;
  EXPECT_EQ(summary["packets"]["total"]["clock_steps"], 0);
  EXPECT_EQ(summary["sweeps"]["processed"], summary["sweeps"]["seen"]);
  EXPECT_GT(summary["sources"][GetParam().imu]["used_sweeps"], 0);
  EXPECT_LT(summary["ape_m"]["max"], 0.2);
}

TEST(LocusSim, PositionPacketsHoldTheTimeOfTheirArrival) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_program(LOCUS_SIM, husky_in("corridor", folder / "c", {"--realism", "clean"})).status, 0);
  auto capture = Capture::open(folder / "c/lidar.pcap");
  ASSERT_TRUE(capture) << capture.error();
  int seen = 0;
  while (const Datagram* datagram = capture->next()) {
    if (datagram->payload.size() != velodyne::kPositionPacketBytes)
      continue;
    const auto packet = velodyne::parse_position_packet(datagram->payload.first<velodyne::kPositionPacketBytes>());
    ASSERT_TRUE(packet.is_synchronised());
    const Duration since_epoch = datagram->receive_stamp.time_since_epoch();
    const Duration behind = since_epoch % std::chrono::hours{1} - packet.time_of_hour;
    ASSERT_GE(behind, Duration::zero());
    ASSERT_LT(behind, std::chrono::milliseconds{5});
    ASSERT_EQ(packet.rmc->time_of_day,
              std::chrono::floor<std::chrono::seconds>((since_epoch - behind) % std::chrono::hours{24}));
    ++seen;
  }
  EXPECT_NEAR(seen, 12 * 753.5 / 5, 2);
}

/// All imperfections, some of which delay stamps. Reassembled, the stream equals the folder, except for the true map.
TEST(LocusSim, StreamEqualsTheFolder) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_program(LOCUS_SIM, husky_in("corridor", folder / "c", {"--lidars", "2"})).status, 0);
  const ProgramRun run = run_program(LOCUS_SIM, husky_in("corridor", "-", {"--lidars", "2"}));
  ASSERT_EQ(run.status, 0) << run.err;
  std::ofstream(folder / "stream.pcap", std::ios::binary) << run.out;

  auto stream = Capture::open(folder / "stream.pcap"), capture = Capture::open(folder / "c/lidar.pcap");
  ASSERT_TRUE(stream) << stream.error();
  std::map<std::string, std::string> texts;
  Stamp last;
  while (const Datagram* datagram = stream->next()) {
    EXPECT_GE(datagram->receive_stamp, last);
    last = datagram->receive_stamp;
    if (datagram->destination_port == sim::kTextPort) {
      const std::string text(reinterpret_cast<const char*>(datagram->payload.data()), datagram->payload.size());
      texts[text.substr(0, text.find('\n'))] += text.substr(text.find('\n') + 1);
      continue;
    }
    const Datagram* recorded = capture->next();
    ASSERT_NE(recorded, nullptr);
    ASSERT_TRUE(std::ranges::equal(datagram->payload, recorded->payload));
  }
  EXPECT_EQ(capture->next(), nullptr);
  EXPECT_EQ(texts.size(), 4U);
  for (const auto& [name, text] : texts)
    EXPECT_TRUE(text == read_text(folder / ("c/" + name))) << name;
}

/// Returns the user CPU time of all ended child processes.
double children_cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

double cpu_of_a_minute_s(const std::string& world, const std::string& realism) {
  const double before_s = children_cpu_s();
  const std::string drive =
      " --world " + world + " --robot husky --duration 60 -o - --realism " + realism + " >/dev/null";
  EXPECT_EQ(run_program("/bin/sh", {"-c", LOCUS_SIM + drive}).status, 0);
  return children_cpu_s() - before_s;
}

/// The target is a tenth; docs/performance.md has measurements. A factor of two is left for loaded machines.
TEST(LocusSim, RunsFiveTimesFasterThanRealTime) {
  for (const std::string world : {"urban", "tunnel"}) {
    const double took_s = cpu_of_a_minute_s(world, "clean");
    EXPECT_LT(took_s, 60.0 / 5) << world;
    RecordProperty(world + "_cpu_ms", static_cast<int>(1e3 * took_s));
  }
}

/// Multiple rays per beam, people, mirrors. Relative to a clean drive in the same run, because a fraction of the
/// simulated time would depend on the machine.
TEST(LocusSim, RunsARealWorldInFourTimesTheTimeOfACleanOne) {
  for (const std::string world : {"urban", "tunnel"}) {
    const double clean_s = cpu_of_a_minute_s(world, "clean"), real_s = cpu_of_a_minute_s(world, "real");
    EXPECT_LT(real_s, 4 * clean_s) << world;
    RecordProperty(world + "_real_cpu_ms", static_cast<int>(1e3 * real_s));
  }
}

/// The levels are documented by --help and the manual for each imperfection; "real" is the default.
TEST(LocusSim, LevelsOfRealismEqualTheirImperfections) {
  const TemporaryFolder folder;
  const auto simulate = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> all{"--world", "corridor", "--robot", "spot", "--duration", "2", "-o", folder / name};
    all.insert(all.end(), more.begin(), more.end());
    const ProgramRun run = run_program(LOCUS_SIM, all);
    ASSERT_EQ(run.status, 0) << run.err;
  };
  std::vector<std::string> real{"--realism", "clean"}, harsh{"--realism", "clean"};
  for (const sim::NamedImperfection& one : sim::kImperfections) {
    real.insert(real.end(), {fmt::format("--{}", one.name), fmt::format("{}", one.real)});
    harsh.insert(harsh.end(), {fmt::format("--{}", one.name), fmt::format("{}", one.harsh)});
  }
  simulate("default", {});
  simulate("real", {"--realism", "real"});
  simulate("real_by_name", real);
  simulate("harsh", {"--realism", "harsh"});
  simulate("harsh_by_name", harsh);
  simulate("clean", {"--realism", "clean"});
  for (const std::string file : {"lidar.pcap", "imu.csv", "vio.tum", "kio.tum", "gt.tum", "config.yaml"}) {
    const auto bytes = [&](const std::string& name) { return read_text(folder / name / file); };
    EXPECT_FALSE(bytes("real").empty()) << file;
    EXPECT_TRUE(bytes("default") == bytes("real")) << file;
    EXPECT_TRUE(bytes("real_by_name") == bytes("real")) << file;
    EXPECT_TRUE(bytes("harsh_by_name") == bytes("harsh")) << file;
    EXPECT_EQ(bytes("clean") == bytes("real"), file == "gt.tum") << file; // affects sensors, not the truth
  }
}

TEST(LocusSim, InvalidOptionsAreNamedInOneLine) {
  const TemporaryFolder folder;
  const std::string x = folder / "x";
  const auto expect_refused = [](const std::vector<std::string>& arguments, const std::string& named) {
    const ProgramRun run = run_program(LOCUS_SIM, arguments);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
    EXPECT_NE(run.err.find(named), std::string::npos) << run.err;
  };
  expect_refused({}, "--");
  expect_refused(husky_in("moon", x), "moon");
  expect_refused({"--wrld", "urban", "-o", x}, "no option --wrld; the nearest is --world");
  expect_refused(husky_in("urban", x, {"--lidars", "4"}), "4");
  expect_refused(husky_in("urban", x, {"--model", "VLS-128"}), "VLS-128");
  expect_refused(husky_in("urban", x, {"--model", "OS1-64"}), "VLP-16,VLP-32C,HDL-32E,OS1-32,OS1-128,XT32");
  expect_refused(husky_in("urban", x, {"--model", "XT32", "--return", "dual"}), "--return dual");
  expect_refused(husky_in("urban", "-", {"--model", "OS1-32"}), "-o -");
  expect_refused(husky_in("urban", x, {"--dust", "nan"}), "dust");
  expect_refused(husky_in("urban", x, {"--dust", "1.5"}), "dust");
  expect_refused(husky_in("urban", x, {"--realism", "cosy"}), "cosy");
  expect_refused(husky_in("urban", x, {"--realism", "real", "--no-noise"}), "--no-noise");
  expect_refused(husky_in("urban", x, {"--body-parts", "1.5"}), "1.5");
  expect_refused(husky_in("urban", x, {"--beam-mrad", "-1"}), "--beam-mrad");
  expect_refused(husky_in("urban", x, {"--slip", "5"}), "--slip 5");
  expect_refused(husky_in("urban", x, {"--slip", "5-50"}), "--slip 5-50");
  expect_refused(husky_in("urban", x, {"--slip", "2-6", "--slip", "5-8"}), "slip");
  expect_refused({"--world", "urban", "--robot", "husky", "--duration", "nan", "-o", x}, "duration");
}

TEST(LocusSim, RequestedVehicleWithoutRoomIsAWarning) {
  const TemporaryFolder folder;
  const auto said = [&](const std::vector<std::string>& options) {
    const ProgramRun run = run_program(LOCUS_SIM, husky_in("corridor", folder / "c", options));
    EXPECT_EQ(run.status, 0) << run.err;
    return run.err;
  };
  EXPECT_EQ(said({"--realism", "clean", "--vehicle-s-per-min", "20"}),
            "locus-sim: warning: --vehicle-s-per-min: there is no room on this drive for a vehicle beside a husky in "
            "--world corridor, so there is none; try a wider world, another seed or a longer drive\n");
  EXPECT_EQ(said({"--realism", "harsh"}), "");
}

TEST(LocusSim, FolderThatCannotBeCreatedIsAnError) {
  const ProgramRun run = run_program(LOCUS_SIM, husky_in("corridor", "/dev/null/folder"));
  EXPECT_EQ(run.status, 1);
  EXPECT_EQ(run.err,
            "locus-sim: /dev/null/folder: the folder cannot be created (Not a directory); choose another with -o\n");
}

/// Detected at the start, not after an hour of driving.
TEST(LocusSim, FileThatCannotBeWrittenIsNamedBeforeTheDrive) {
  for (const std::string name : {"lidar.pcap", "gt_map.ply"}) {
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder / ("c/" + name));
    const ProgramRun run = run_program(LOCUS_SIM, husky_in("corridor", folder / "c"));
    EXPECT_EQ(run.status, 1);
    EXPECT_EQ(run.err, "locus-sim: " + (folder / ("c/" + name)).string() +
                           ": cannot be written (Is a directory); check permissions and free space\n");
    EXPECT_FALSE(std::filesystem::exists(folder / "c/imu.csv"));
  }
}

TEST(LocusSim, HelpShowsAnExample) {
  const ProgramRun run = run_program(LOCUS_SIM, {"--help"});
  EXPECT_EQ(run.status, 0);
  EXPECT_NE(run.out.find("locus-sim --world urban"), std::string::npos);
  EXPECT_EQ(run_program(LOCUS_SIM, {"--version"}).status, 0);
}

} // namespace
} // namespace locus::test
