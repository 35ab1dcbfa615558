// SPDX-License-Identifier: Apache-2.0
// The table of faults in small: every row on one seed of a minute.
#include <map>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"

namespace locus::test {
namespace {

using nlohmann::json;

/// What does not hold, by course and configuration; docs/robustness.md tells why.
const std::map<std::string, std::set<std::string>> kKnown{
    {"corridor/none", {"doubt across the way grows"}},
    {"spot/vio_kio_imu_lost", {"more error than allowed", "not flagged"}}};

TEST(FaultsOnCourses, EveryRowOfTheTableHoldsForAMinute) {
  const TemporaryFolder folder;
  const ProgramRun run = run_program(LOCUS_EXPERIMENTS, {"--faults", "--quiet", "--duration", "60", "--seeds", "1",
                                                         "--consistency", "0", "-o", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.err;
  const json faults = json::parse(read_text(folder / "out/results.json"))["faults"];
  EXPECT_EQ(faults["rows"].size(), 51U);
  for (const json& row : faults["rows"]) {
    const std::string id = row["course"].get<std::string>() + '/' + row["configuration"].get<std::string>();
    const auto known = kKnown.find(id);
    for (const json& broken : row["broken"])
      EXPECT_TRUE(known != kKnown.end() && known->second.contains(broken.get<std::string>())) << row.dump(1);
    EXPECT_EQ(row["sweeps"]["lost"], 0) << id;
    if (row["configuration"] != "lidar_gap") {
      EXPECT_EQ(row["sweeps"]["failed"], 0) << id;
    }
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "out/faults.md"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/courses"));
}

} // namespace
} // namespace locus::test
