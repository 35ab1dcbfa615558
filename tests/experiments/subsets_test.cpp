// SPDX-License-Identifier: Apache-2.0
// locus-experiments --subsets, on a recording of 8 s.
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"
#include "support/test_drives.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

ProgramRun subsets(const std::vector<std::string>& more) {
  std::vector<std::string> arguments{"--subsets", "--quiet", "--jobs", "2"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program(LOCUS_EXPERIMENTS, arguments);
}

const json& part(const json& row, const std::string& name) {
  for (const json& subset : row["subsets"]) {
    if (subset["subset"] == name)
      return subset;
  }
  throw std::out_of_range(name);
}

TEST(Subsets, EveryPartOfARecordingIsMeasuredInEveryView) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "recordings");
  std::filesystem::copy(room_drive(), folder / "recordings/true");
  std::filesystem::copy(room_drive(), folder / "recordings/untrue");
  std::filesystem::remove(folder / "recordings/untrue/gt.tum");
  const ProgramRun run = subsets({"-o", folder / "out", folder / "recordings"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json rows = json::parse(read_text(folder / "out/results.json"))["subsets"]["rows"];
  ASSERT_EQ(rows.size(), 3U);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const json& row = rows[i];
    EXPECT_EQ(row["view_deg"], (std::vector{360, 180, 90}[i]));
    std::set<std::string> parts;
    for (const json& subset : row["subsets"]) {
      ASSERT_TRUE(subset.contains("mean_m")) << subset;
      EXPECT_GE(subset["worst_m"].get<double>(), subset["mean_m"].get<double>()) << subset;
      parts.insert(subset["subset"]);
    }
    EXPECT_EQ(parts, (std::set<std::string>{"all", "all but imu", "lidar", "lidar and IMU", "wio alone"}));
    EXPECT_TRUE(row["best"].is_string());
    EXPECT_EQ(part(row, "wio alone")["mean_m"], part(rows[0], "wio alone")["mean_m"]) << "no view";
  }
  EXPECT_LT(part(rows[0], "all")["mean_m"].get<double>(), part(rows[0], "wio alone")["mean_m"].get<double>());
  EXPECT_NE(part(rows[0], "lidar")["mean_m"], part(rows[2], "lidar")["mean_m"]) << "fewer returns";
  const std::string page = read_text(folder / "out/subsets.md");
  EXPECT_NE(page.find("Of 3 drives and views, "), std::string::npos) << page;
  EXPECT_NE(page.find("Skipped, because they have no truth: untrue.\n"), std::string::npos) << page;
}

TEST(Subsets, FoldersWithoutTruthAreAnErrorThatExplainsWhereToPutIt) {
  const TemporaryFolder folder;
  std::filesystem::copy(room_drive(), folder / "untrue");
  std::filesystem::remove(folder / "untrue/gt.tum");
  const ProgramRun run = subsets({"-o", folder / "out", folder / "untrue"});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("gt.tum"), std::string::npos) << run.err;
}

TEST(Subsets, OptionsOfOtherTablesAreErrors) {
  EXPECT_EQ(subsets({"--harsh", "-o", "out"}).status, 2);
  EXPECT_EQ(run_program(LOCUS_EXPERIMENTS, {"--starts", "2", "-o", "out"}).status, 2);
  EXPECT_EQ(run_program(LOCUS_EXPERIMENTS, {"--only", "plant", "-o", "out"}).status, 2);
}

} // namespace
} // namespace locus::test
