// SPDX-License-Identifier: Apache-2.0
// The harsh table at reduced size: the real world, and people in a bare corridor; and that of subsets.
#include <string>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// Expects every figure to exist and to be plausible; docs/robustness.md lists the rows that hold, which are not tested
/// here.
void expect_sound(const json& row) {
  EXPECT_EQ(row["failed"], 0) << row;
  EXPECT_EQ(row["drives"], 10) << row;
  EXPECT_GE(row["worst_m"].get<double>(), row["median_m"].get<double>()) << row;
  EXPECT_GT(row["true_mps"].get<double>(), 0.5) << row;
  EXPECT_GE(row["lost"].get<int>(), row["flagged"].get<int>()) << row;
  EXPECT_EQ(row["holds"], row["broken"].empty()) << row;
}

class HarshOnCourses : public testing::TestWithParam<const char*> {};

TEST_P(HarshOnCourses, EveryDriveIsMeasured) {
  const TemporaryFolder folder;
  const ProgramRun run = run_program(LOCUS_EXPERIMENTS, {"--harsh", "--only", GetParam(), "--quiet", "--duration", "40",
                                                         "--seeds", "1", "--jobs", "2", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json rows = json::parse(read_text(folder / "out/results.json"))["harsh"]["rows"];
  ASSERT_EQ(rows.size(), 3U);
  int standing = 0;
  for (const json& row : rows) {
    expect_sound(row);
    standing += row["standing"].get<int>();
  }
  EXPECT_GT(standing, 0) << "no drive begins at standstill";
  EXPECT_LT(standing, 30) << "no drive begins in motion";
  EXPECT_NE(read_text(folder / "out/harsh.md").find("rows hold."), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/courses"));
}

INSTANTIATE_TEST_SUITE_P(SmallForm, HarshOnCourses, testing::Values("plant/real", "corridor/people"));

TEST(SubsetsOnACourse, EveryPartOfTwoDrivesIsMeasuredInEveryView) {
  const TemporaryFolder folder;
  const ProgramRun run =
      run_program(LOCUS_EXPERIMENTS, {"--subsets", "--only", "plant, spot/real", "--quiet", "--duration", "16",
                                      "--seeds", "1", "--starts", "2", "--jobs", "2", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json rows = json::parse(read_text(folder / "out/results.json"))["subsets"]["rows"];
  ASSERT_EQ(rows.size(), 2U * 3U);
  for (const json& row : rows) {
    EXPECT_EQ(row["subsets"].size(), 6U + 2U) << row << ": with and without each source, and vio and kio alone";
    EXPECT_NE(row["verdict"], "failed") << row;
  }
  EXPECT_NE(read_text(folder / "out/subsets.md").find("| plant, spot/real 1, from 4 s | 90 |"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/courses"));
}

} // namespace
} // namespace locus::test
