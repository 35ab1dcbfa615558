// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"
#include "support/child.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

ProgramRun experiments(const std::vector<std::string>& arguments) { return run_program(LOCUS_EXPERIMENTS, arguments); }

json results_in(const std::filesystem::path& folder) { return json::parse(read_text(folder / "results.json")); }

std::set<std::string> runs_in(const json& results) {
  std::set<std::string> ids;
  for (const json& run : results["runs"]) {
    EXPECT_FALSE(run.contains("failed")) << run["failed"];
    ids.insert(run["course"].get<std::string>() + '/' + run["configuration"].get<std::string>());
  }
  return ids;
}

TEST(LocusExperiments, TwoShardsOfAFleetsRecordingsMakeOnePage) {
  const TemporaryFolder folder;
  const std::string robot = folder / "1/courses/robot", one = folder / "1", two = folder / "2", all = folder / "all";
  std::filesystem::create_directories(folder / "1/courses");
  std::filesystem::copy(room_drive(), robot);
  for (const auto& [shard, output] : {std::pair{"1/2", one}, std::pair{"2/2", two}}) {
    const ProgramRun run = experiments({"--shard", shard, "--pace", "10", "-o", output, robot});
    ASSERT_EQ(run.status, 0) << run.err;
  }
  const std::set<std::string> first = runs_in(results_in(one)), second = runs_in(results_in(two));
  EXPECT_EQ(first.size(), 2U);
  EXPECT_EQ(second.size(), 2U);

  EXPECT_TRUE(std::filesystem::exists(robot + "/lidar.pcap"));
  const ProgramRun part = experiments({"--merge", two, "-o", all});
  EXPECT_EQ(part.status, 1);
  EXPECT_NE(part.err.find("2 of the 4 runs"), std::string::npos) << part.err;

  std::filesystem::create_directories(std::filesystem::path(all) / "courses/mine");
  const ProgramRun merging = experiments({"--merge", one, two, "-o", all});
  EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(all) / "courses/mine"));
  ASSERT_EQ(merging.status, 0) << merging.err;
  const json merged = results_in(all);
  EXPECT_EQ(runs_in(merged),
            (std::set<std::string>{"robot/locusd", "robot/paper", "robot/pace_1cpu", "robot/pace_2cpu"}));
  for (const json& run : merged["runs"]) {
    const bool paced = run["configuration"].get<std::string>().starts_with("pace");
    EXPECT_LT(run["summary"]["ape_m"]["max"].get<double>(), 0.1) << run["configuration"];
    EXPECT_EQ(run.contains("position_error"), !paced);
    EXPECT_GT(run["summary"]["wall_s"].get<double>(), paced ? 7.5 : 0.0) << "at the pace of the recording, if at any";
  }
  const std::string page = read_text(std::filesystem::path(all) / "experiments.html");
  EXPECT_NE(page.find("\"configuration\":\"pace_2cpu\""), std::string::npos);
  EXPECT_EQ(page.find("@DATA@"), std::string::npos);
}

TEST(LocusExperiments, LoamFeaturesReplaceTheFilters) {
  const TemporaryFolder folder;
  const ProgramRun run =
      run_program(LOCUS_EXPERIMENTS, {"replay-with-loam-features", "--quiet", "--set", "segment_filter.enabled=false",
                                      "-o", folder / "out", room_drive().string()});
  ASSERT_EQ(run.status, 0) << run.err;
  const json summary = json::parse(read_text(folder / "out/summary.json"));
  EXPECT_LT(summary["points"]["filtered_mean"].get<double>(), 16 * 4 * (20 + 40));
  EXPECT_GT(summary["points"]["filtered_mean"].get<double>(), 500.0);
  EXPECT_LT(summary["ape_m"]["max"].get<double>(), 0.1);
}

TEST(LocusExperiments, ARunThatFailsIsNamedAndTheOthersGoOn) {
  const TemporaryFolder folder;
  const std::string empty = folder / "empty", robot = folder / "robot";
  std::filesystem::create_directories(empty);
  std::filesystem::copy(room_drive(), robot);
  const ProgramRun run = experiments({"--shard", "1/4", "--quiet", "-o", folder / "out", empty, robot});
  EXPECT_EQ(run.status, 1);
  EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  EXPECT_NE(run.err.find("empty/locusd: "), std::string::npos) << run.err;
  const json results = results_in(folder / "out");
  ASSERT_EQ(results["runs"].size(), 2U);
  EXPECT_TRUE(results["runs"][0].contains("failed"));
  EXPECT_FALSE(results["runs"][1].contains("failed"));
}

bool some_program_runs_with(const std::string& word) {
  return std::ranges::any_of(std::filesystem::directory_iterator("/proc"), [&](const auto& process) {
    return read_text(process.path() / "cmdline").find(word) != std::string::npos;
  });
}

/// They may be gigabytes.
TEST(LocusExperiments, InterruptedItLeavesNoCoursesAndNoProgramBehind) {
  const TemporaryFolder folder;
  const std::filesystem::path courses = folder / "out/courses";
  Child run({LOCUS_EXPERIMENTS, "--duration", "36000", "--quiet", "-o", folder / "out"});
  for (int i = 0; i < 200 && (!std::filesystem::exists(courses) || std::filesystem::is_empty(courses)); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
  run.signal(SIGHUP);
  EXPECT_EQ(run.wait_for_exit(std::chrono::seconds{10}), 128 + SIGHUP) << testing::PrintToString(run.lines());
  EXPECT_FALSE(std::filesystem::exists(courses));
  EXPECT_FALSE(some_program_runs_with(courses.string())) << "it simulates still";
}

TEST(LocusExperiments, WrongUsageIsExplainedInOneLine) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{},
                                                    {"-o", "/tmp/x", "--shard", "3/2"},
                                                    {"-o", "/tmp/x", "--jobs", "0"},
                                                    {"-o", "/tmp/x", "--shard", "1/2", "--merge", "/tmp/y"},
                                                    {"-o", "/tmp/x", "--frobnicate"}}) {
    const ProgramRun run = experiments(arguments);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  }
  const ProgramRun merging = experiments({"--merge", "/nowhere", "-o", TemporaryFolder() / "out"});
  EXPECT_EQ(merging.status, 1);
  EXPECT_NE(merging.err.find("/nowhere/results.json: no results"), std::string::npos) << merging.err;
}

TEST(LocusExperiments, WhatCannotBeComparedWithIsRefusedBeforeAnythingRuns) {
  const TemporaryFolder folder;
  std::ofstream{folder / "paper.json"} << R"({"version": "1", "duration_s": 300, "runs": []})";
  for (const auto& [before, problem] : {std::pair{"/nowhere/results.json", "/nowhere/results.json: no results"},
                                        std::pair{"paper.json", "paper.json: holds no results of the same"}}) {
    const ProgramRun run = experiments({"--faults", "--compare", folder.path() / before, "-o", folder / "out"});
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find(problem), std::string::npos) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(LocusExperiments, HelpHasAnExampleAndVersionIsTold) {
  const ProgramRun help = experiments({"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_NE(help.out.find("locus-experiments -o experiments"), std::string::npos);
  EXPECT_EQ(experiments({"--version"}).out.rfind("locus-experiments ", 0), 0U);
}

} // namespace
} // namespace locus::test
