// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_table.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "locus_experiments/fault_plan.hpp"

namespace locus::experiments {
namespace {

/// A faultless run.
Results run(const std::string& course, const std::string& configuration, double ape_m) {
  Results run{{"course", course}, {"configuration", configuration}, {"machine", "a machine"}};
  run["summary"] = {{"sweeps", {{"seen", 600}, {"processed", 600}, {"dropped", 0}, {"failed", 0}}},
                    {"sources", {{"wio", {{"health_changes", 0}}}, {"imu", {{"health_changes", 0}}}}},
                    {"ape_m", {{"mean", ape_m}}},
                    {"covariance", {{"nees_10m", 6.0}, {"worst_sigma", 2.0}}}};
  run["fault"] = {{"length_m", 228.4},
                  {"added_m", 0.0},
                  {"told", 0.0},
                  {"growth", {{"along", 50.0}, {"across", 1.5}}},
                  {"sources", {{"wio", {{"added_m", 0.1}, {"ape_mean_m", 0.2}}}}}};
  return run;
}

Results& health_changes(Results& run, const char* source) {
  return run["summary"]["sources"][source]["health_changes"];
}

/// Returns the only row of the table with a fault; one seed per pair of runs.
Results row_of(const std::vector<Results>& runs, const std::string& course, const std::string& configuration) {
  Results results{{"version", "1"},
                  {"simulated", true},
                  {"duration_s", 60},
                  {"runs", runs},
                  {"faults", {{"seeds", 3}, {"consistency_runs", 0}}}};
  judge_faults(results);
  const Results& rows = results["faults"]["rows"];
  const auto row = std::ranges::find_if(
      rows, [&](const Results& each) { return each["course"] == course && each["configuration"] == configuration; });
  return row == rows.end() ? Results{} : *row;
}

Results wio_frozen(double ape_m, int changes, const std::string& course = "urban_1") {
  Results frozen = run(course, "wio_frozen", ape_m);
  health_changes(frozen, "wio") = changes;
  return frozen;
}

TEST(FaultTable, RowHoldsWithinAFifthOrACentimetre) {
  const auto holds = [](double without_m, double with_m) {
    return row_of({run("urban_1", "none", without_m), wio_frozen(with_m, 2)}, "urban", "wio_frozen")["holds"];
  };
  EXPECT_TRUE(holds(0.002, 0.011));
  EXPECT_FALSE(holds(0.002, 0.013));
  EXPECT_TRUE(holds(0.1, 0.119));
  EXPECT_FALSE(holds(0.1, 0.121));
}

TEST(FaultTable, MedianOfThePairsDecides) {
  std::vector<Results> runs;
  for (const auto& [seed, with_m] : {std::pair{1, 0.100}, std::pair{2, 0.205}, std::pair{3, 0.900}}) {
    runs.push_back(run(fault_course("urban", seed), "none", 0.1 * seed));
    runs.push_back(wio_frozen(with_m, 2, fault_course("urban", seed)));
  }
  const Results row = row_of(runs, "urban", "wio_frozen");
  EXPECT_TRUE(row["holds"]) << row;
  EXPECT_EQ(row["found"], "+5.0 mm of 40.0 mm");
}

TEST(FaultTable, SourceMustBeLostAndReturn) {
  const auto row = [](int changes) {
    return row_of({run("urban_1", "none", 0.1), wio_frozen(0.1, changes)}, "urban", "wio_frozen");
  };
  EXPECT_EQ(row(0)["broken"][0], "wio is not detected on every seed");
  EXPECT_EQ(row(1)["broken"][0], "wio is not used again on every seed");
  EXPECT_TRUE(row(2)["holds"]);
  EXPECT_EQ(row(4)["health"][0], "wio lost, used again, up to 2 x");
}

TEST(FaultTable, LostAndFailedSweepsBreakARowUnlessLidarIsAbsent) {
  Results fewer = wio_frozen(0.1, 2), failing = fewer, gap = run("urban_1", "lidar_gap", 0.1);
  fewer["summary"]["sweeps"]["seen"] = 590;
  failing["summary"]["sweeps"]["failed"] = 3;
  gap["summary"]["sweeps"]["failed"] = 99;
  const Results without = run("urban_1", "none", 0.1);
  EXPECT_EQ(row_of({without, fewer}, "urban", "wio_frozen")["broken"][0], "sweeps are lost");
  EXPECT_EQ(row_of({without, failing}, "urban", "wio_frozen")["broken"][0], "sweeps fail");
  EXPECT_TRUE(row_of({without, gap}, "urban", "lidar_gap")["holds"]);
}

TEST(FaultTable, GapIsJudgedByTheDriftOfTheSource) {
  Results gap = run("urban_1", "lidar_gap", 0.1);
  gap["fault"]["added_m"] = 0.149;
  EXPECT_TRUE(row_of({run("urban_1", "none", 0.1), gap}, "urban", "lidar_gap")["holds"]);
  gap["fault"]["added_m"] = 0.151;
  EXPECT_FALSE(row_of({run("urban_1", "none", 0.1), gap}, "urban", "lidar_gap")["holds"]);
}

TEST(FaultTable, LossThatAddsErrorMustBeFlaggedAndWithinSigma) {
  const auto row = [](double told, double sigmas) {
    Results lost = run("tunnel_1", "wio_lost", 0.5);
    health_changes(lost, "wio") = 1;
    lost["fault"]["told"] = told;
    lost["summary"]["covariance"]["worst_sigma"] = sigmas;
    return row_of({run("tunnel_1", "none", 0.01), lost}, "tunnel", "wio_lost");
  };
  EXPECT_TRUE(row(0.2, 2.9)["holds"]);
  EXPECT_FALSE(row(0.2, 3.1)["holds"]);
  EXPECT_FALSE(row(0.0, 2.9)["holds"]);
}

TEST(FaultTable, CorridorIsJudgedByWheelsAndSigmaGrowth) {
  Results corridor = run("corridor_1", "none", 0.19);
  EXPECT_TRUE(row_of({corridor}, "corridor", "none")["holds"]);
  corridor["fault"]["growth"]["across"] = 2.1;
  EXPECT_EQ(row_of({corridor}, "corridor", "none")["broken"][0], "variance across the path grows");
  EXPECT_EQ(row_of({run("corridor_1", "none", 0.21)}, "corridor", "none")["broken"][0], "worse than the wheels");
}

TEST(FaultTable, SlipIsComparedWithTheDriveWithoutIt) {
  Results slip = run("slip_1", "none", 0.04);
  EXPECT_TRUE(row_of({run("urban_1", "none", 0.01), slip}, "slip", "none")["holds"]);
  slip["fault"]["added_m"] = 0.06;
  EXPECT_FALSE(row_of({run("urban_1", "none", 0.01), slip}, "slip", "none")["holds"]);
}

TEST(FaultTable, FailedRunDoesNotHold) {
  const Results failed{{"course", "urban_1"}, {"configuration", "wio_frozen"}, {"failed", "it crashed"}};
  const Results row = row_of({run("urban_1", "none", 0.1), failed}, "urban", "wio_frozen");
  EXPECT_FALSE(row["holds"]);
  EXPECT_EQ(row["broken"][0], "seed 1 failed");
}

/// The mean over the remaining runs would look good.
TEST(FaultTable, FailedCovarianceRunsAreCountedAndDoNotHold) {
  Results stood = run("honesty_2", "none", 0.1);
  stood["summary"]["covariance"]["nees_10m"] = nullptr;
  const Results crashed{{"course", "honesty_3"}, {"configuration", "none"}, {"failed", "it crashed"}};
  Results results{{"version", "1"},
                  {"simulated", true},
                  {"duration_s", 60},
                  {"runs", {run("honesty_1", "none", 0.1), stood, crashed}},
                  {"faults", {{"seeds", 1}, {"consistency_runs", 3}}}};
  judge_faults(results);
  const Results& consistency = results["faults"]["consistency"];
  EXPECT_EQ(consistency["runs"], 1);
  EXPECT_EQ(consistency["failed"], 2);
  EXPECT_FALSE(consistency["holds"]);
  const std::string text = fault_table(results);
  EXPECT_NE(text.find("**does not hold**; 2 more runs failed."), std::string::npos) << text;
}

TEST(FaultTable, SweepsMayFailDuringAMissingLidar) {
  Results late = run("urban_1", "lidar_late", 0.1);
  late["summary"]["sweeps"]["failed"] = 3;
  const Results without = run("urban_1", "none", 0.1);
  EXPECT_TRUE(row_of({without, late}, "urban", "lidar_late")["holds"]);
  late["summary"]["sweeps"]["failed"] = 4;
  EXPECT_EQ(row_of({without, late}, "urban", "lidar_late")["broken"][0], "sweeps fail");
}

TEST(FaultTable, MarkdownStatesWhatHolds) {
  Results results{{"version", "1"},
                  {"simulated", true},
                  {"duration_s", 60},
                  {"runs",
                   {run("urban_1", "none", 0.002), wio_frozen(0.5, 2), run("honesty_1", "none", 0.1),
                    run("honesty_2", "none", 0.1)}},
                  {"faults", {{"seeds", 1}, {"consistency_runs", 2}}}};
  judge_faults(results);
  const std::string text = fault_table(results);
  EXPECT_NE(text.find("a machine. 1 of 2 rows hold."), std::string::npos) << text;
  EXPECT_NE(
      text.find("| none | husky, plant, 228 m | 2.0 | 2.0 | error <= 20.0 mm | 2.0 mm | yes | 0, 0 |  | 2.0 | 6.0 |"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("| **no**: more error than allowed |"), std::string::npos) << text;
  EXPECT_NE(text.find("mean over 2 seeded runs of 60 s, is 6.0"), std::string::npos) << text;
  EXPECT_NE(text.find("holds.\n"), std::string::npos) << text;
}

} // namespace
} // namespace locus::experiments
