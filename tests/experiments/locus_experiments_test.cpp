// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"
#include "support/child.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

ProgramRun experiments(const std::vector<std::string>& arguments) { return run_program(LOCUS_EXPERIMENTS, arguments); }

json results_in(const std::filesystem::path& folder) { return json::parse(read_text(folder / "results.json")); }

/// Returns start and end of each run in ms from Ninja's log, by COURSE/CONFIGURATION.
std::map<std::string, std::pair<int, int>> times_in(const std::filesystem::path& folder) {
  std::map<std::string, std::pair<int, int>> times;
  std::ifstream log{folder / ".ninja_log"};
  std::string line;
  std::getline(log, line); // log version
  int begin_ms = 0, end_ms = 0;
  for (std::string modified, file, hash; log >> begin_ms >> end_ms >> modified;) {
    std::getline(log >> std::ws, file, '\t');
    std::getline(log, hash);
    if (file.ends_with("/row.json"))
      times[std::filesystem::path(file).parent_path().lexically_relative(folder / "runs")] = {begin_ms, end_ms};
  }
  return times;
}

TEST(LocusExperiments, SeveralRecordingsGiveOnePage) {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder / "out", robot = folder / "robot's $1";
  std::filesystem::create_directories(out / "courses/mine");
  std::filesystem::create_directories(folder / "empty");
  std::filesystem::copy(room_drive(), robot);
  const ProgramRun run = experiments({"--pace", "10", "--jobs", "2", "-o", out, folder / "empty", robot});
  EXPECT_EQ(run.status, 1) << "one is empty";
  EXPECT_TRUE(std::filesystem::exists(robot / "lidar.pcap"));
  EXPECT_TRUE(std::filesystem::exists(out / "courses/mine"));
  for (const char* line : {"[1/8] run ", "[8/8] run ", "] run robot's $1/paper\n", "results in "})
    EXPECT_NE(run.out.find(line), std::string::npos) << run.out;
  const std::vector<std::string> failures = lines_of(run.err);
  ASSERT_EQ(failures.size(), 4U) << run.err;
  EXPECT_EQ(failures[0].rfind("locus-experiments: empty/locusd: locus-replay: ", 0), 0U) << failures[0];

  std::set<std::string> configurations;
  const json results = results_in(out);
  for (const json& each : results["runs"]) {
    const auto configuration = each["configuration"].get<std::string>();
    const bool paced = configuration.starts_with("pace");
    ASSERT_EQ(each.contains("failed"), each["course"] == "empty") << each;
    if (each.contains("failed"))
      continue;
    configurations.insert(configuration);
    if (!paced) {
      EXPECT_LT(each["summary"]["ape_m"]["max"].get<double>(), 0.1) << configuration;
    }
    EXPECT_EQ(each.contains("position_error"), !paced);
    EXPECT_GT(each["summary"]["wall_s"].get<double>(), paced ? 7.5 : 0.0) << "at the pace of the recording, if at any";
  }
  EXPECT_EQ(configurations, (std::set<std::string>{"locusd", "paper", "pace_1cpu", "pace_2cpu"}));
  const std::string page = read_text(out / "experiments.html");
  EXPECT_NE(page.find("\"configuration\":\"pace_2cpu\""), std::string::npos);
  EXPECT_EQ(page.find("@DATA@"), std::string::npos);

  const auto times = times_in(out);
  EXPECT_EQ(times.size(), 8U);
  for (const auto& [paced, when] : times) {
    for (const auto& [other, when_other] : times) {
      const bool other_is_paced = other.find("pace_") != std::string::npos;
      if (paced.find("pace_") != std::string::npos && paced != other) {
        EXPECT_TRUE(when_other.second <= when.first || (other_is_paced && when_other.first >= when.second))
            << paced << " is neither alone nor after the others: " << other;
      }
    }
  }
  const std::string described = read_text(out / "build.ninja");
  EXPECT_NE(described.find("= taskset --cpu-list "), std::string::npos) << described;
  EXPECT_NE(described.find("\n  cpus = 2\n"), std::string::npos) << described;
}

TEST(LocusExperiments, RunsAtAPaceAreAsAccurateAsOthers) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder / "robot");
  ASSERT_EQ(experiments({"--pace", "10", "--jobs", "2", "-o", folder / "out", folder / "robot"}).status, 0);
  for (const json& each : results_in(folder / "out")["runs"])
    EXPECT_LT(each["summary"]["ape_m"]["max"].get<double>(), 0.1) << each["configuration"];
}

/// A stand-in for a launcher such as srun.
TEST(LocusExperiments, LauncherStartsSimulationsAndRuns) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder / "robot");
  const ProgramRun run = experiments({"--accuracy", "--quiet", "-o", folder / "out", folder / "robot", "--launcher",
                                      "sh -c 'echo $cpus >> " + (folder / "launched").string() + "; exec \"$$@\"' --"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.out, "");
  EXPECT_EQ(read_text(folder / "launched"), "1\n1\n1\n");
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

TEST(LocusExperiments, FailedSimulationIsTheReasonOfItsRuns) {
  const TemporaryFolder folder;
  const ProgramRun run =
      experiments({"--fault-matrix", "--quiet", "--duration", "10", "-o", folder / "out", "--launcher", "false"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("urban_1/none: failed without an error message"), std::string::npos) << run.err;
  EXPECT_TRUE(std::filesystem::exists(folder / "out/matrix.md"));
}

TEST(LocusExperiments, KilledRunIsNamed) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder / "robot");
  const ProgramRun run =
      experiments({"--quiet", "-o", folder / "out", folder / "robot", "--launcher", "sh -c 'kill -SEGV $$$$' --"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("robot/paper: ended by signal 11"), std::string::npos) << run.err;
}

/// Every run but the first blocks until it is killed.
TEST(LocusExperiments, ResumesAfterKill) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "fleet");
  for (const char* name : {"one", "three", "two's"})
    std::filesystem::copy(room_drive(), folder / "fleet" / name);
  const std::filesystem::path held = folder / "held";
  std::ofstream{held} << "";
  const std::string launcher = "sh -c 'mkdir " + (folder / "first").string() + " || while [ -e " + held.string() +
                               " ]; do sleep 0.1; done; exec \"$$@\"' --";
  const std::vector<std::string> arguments{"--accuracy",   "--jobs",     "1",      "-o",
                                           folder / "out", "--launcher", launcher, folder / "fleet"};
  std::vector<std::string> command = arguments;
  command.insert(command.begin(), LOCUS_EXPERIMENTS);
  Child first(command);
  ASSERT_TRUE(first.wait_for_line("[1/3] ")) << testing::PrintToString(first.lines());
  first.signal(SIGKILL);
  ASSERT_EQ(first.wait_for_exit(), 128 + SIGKILL);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/results.json"));
  const auto before = times_in(folder / "out");
  EXPECT_EQ(before.size(), 1U);
  std::filesystem::remove(held);

  const ProgramRun second = experiments(arguments);
  ASSERT_EQ(second.status, 0) << second.err;
  EXPECT_EQ(second.out.find("/3] "), std::string::npos) << "starts from the beginning: " << second.out;
  EXPECT_EQ(results_in(folder / "out")["recordings"].size(), 3U);
  const auto after = times_in(folder / "out");
  EXPECT_EQ(after.size(), 9U);
  for (const auto& [run, when] : before)
    EXPECT_EQ(after.at(run), when) << run;

  const ProgramRun third = experiments(arguments);
  EXPECT_EQ(third.status, 0) << third.err;
  EXPECT_EQ(third.out.find("[1/"), std::string::npos) << "repeats a run: " << third.out;
  EXPECT_EQ(times_in(folder / "out"), after);
}

bool some_program_runs_with(const std::string& word) {
  return std::ranges::any_of(std::filesystem::directory_iterator("/proc"), [&](const auto& process) {
    return read_text(process.path() / "cmdline").find(word) != std::string::npos;
  });
}

/// Waits until it holds; false after the test's patience.
bool comes_true(const std::function<bool()>& holds) {
  const auto give_up = std::chrono::steady_clock::now() + patience();
  while (!holds() && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
  return holds();
}

TEST(LocusExperiments, InterruptionEndsAllChildren) {
  const TemporaryFolder folder;
  const std::filesystem::path courses = folder / "out/courses";
  Child run({LOCUS_EXPERIMENTS, "--duration", "36000", "--quiet", "-o", folder / "out"});
  EXPECT_TRUE(comes_true([&] { return std::filesystem::exists(courses) && !std::filesystem::is_empty(courses); }));
  run.signal(SIGHUP);
  EXPECT_EQ(run.wait_for_exit(), 128 + SIGHUP) << testing::PrintToString(run.lines());
  EXPECT_TRUE(comes_true([&] { return !some_program_runs_with(courses.string()); })) << "simulation has not finished";
}

TEST(LocusExperiments, WrongUsageIsExplainedInOneLine) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{}, {"-o", "/tmp/x", "--jobs", "0"}, {"-o", "/tmp/x", "--frobnicate"}}) {
    const ProgramRun run = experiments(arguments);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  }
}

TEST(LocusExperiments, IncomparableResultsAreAnErrorBeforeAnyRun) {
  const TemporaryFolder folder;
  std::ofstream{folder / "paper.json"} << R"({"version": "1", "duration_s": 300, "runs": []})";
  for (const auto& [before, problem] : {std::pair{"/nowhere/results.json", "/nowhere/results.json: no results"},
                                        std::pair{"paper.json", "paper.json: contains no results of this"}}) {
    const ProgramRun run = experiments({"--faults", "--compare", folder.path() / before, "-o", folder / "out"});
    EXPECT_EQ(run.status, 1);
    EXPECT_NE(run.err.find(problem), std::string::npos) << run.err;
    EXPECT_EQ(lines_of(run.err).size(), 1U) << run.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(LocusExperiments, HelpHasAnExampleAndVersionIsPrinted) {
  const ProgramRun help = experiments({"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_NE(help.out.find("locus-experiments -o experiments"), std::string::npos);
  EXPECT_EQ(experiments({"--version"}).out.rfind("locus-experiments ", 0), 0U);
}

} // namespace
} // namespace locus::test
