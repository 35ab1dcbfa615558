// SPDX-License-Identifier: Apache-2.0
// locus-experiments --accuracy --simulated, on drives of minimum length.
#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

TEST(AccuracyOnDrives, SimulatedDrivesAreOnThePageAndRemoved) {
  const TemporaryFolder folder;
  const ProgramRun run = run_program(
      LOCUS_EXPERIMENTS, {"--accuracy", "--simulated", "--duration", "10", "--quiet", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json recordings = json::parse(read_text(folder / "out/results.json"))["recordings"];
  ASSERT_EQ(recordings.size(), 3U);
  for (const json& drive : recordings) {
    ASSERT_EQ(drive["runs"].size(), 3U) << drive;
    EXPECT_EQ(drive["simulation"][0], "--world");
    for (const json& each : drive["runs"])
      EXPECT_TRUE(each.contains("way")) << each;
  }
  const std::string page = read_text(folder / "out/accuracy.md");
  EXPECT_NE(page.find("## Simulated drives"), std::string::npos) << page;
  EXPECT_NE(page.find("`locus-sim --world tunnel"), std::string::npos) << page;
  EXPECT_FALSE(std::filesystem::exists(folder / "out/courses"));
}

} // namespace
} // namespace locus::test
