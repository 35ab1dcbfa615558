// SPDX-License-Identifier: Apache-2.0
// The harsh table at reduced size: the real world, and people in a bare corridor.
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
  EXPECT_GT(standing, 0) << "no drive begins at a stand";
  EXPECT_LT(standing, 30) << "no drive begins in motion";
  EXPECT_NE(read_text(folder / "out/harsh.md").find("rows hold."), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/courses"));
}

INSTANTIATE_TEST_SUITE_P(SmallForm, HarshOnCourses, testing::Values("plant/real", "corridor/people"));

} // namespace
} // namespace locus::test
