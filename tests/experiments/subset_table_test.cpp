// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_table.hpp"

#include <functional>
#include <string>

#include <gtest/gtest.h>

namespace locus::experiments {
namespace {

/// A run that is never lost.
Results run_of(const std::string& subset, double mean_m) {
  Results run{{"course", "plant_real_1"},
              {"configuration", "360_" + subset},
              {"machine", "a machine"},
              {"drive", "plant/real 1"},
              {"view_deg", 360},
              {"subset", subset},
              {"sound", true},
              {"unsound", Results::array()}};
  run["summary"] = {{"ape_m", {{"mean", mean_m}, {"max", 3 * mean_m}}}, {"covariance", {{"worst_sigma", 2.0}}}};
  run["figures"] = {{"tracking", 1.0},
                    {"lost_after_s", nullptr},
                    {"flagged_after_s", nullptr},
                    {"odometry", {{"wio", {{"mean_m", 0.2}, {"worst_m", 0.25}, {"lost_after_s", nullptr}}}}}};
  return run;
}

void lose(Results& run, const Results& flagged_after_s, double worst_sigma = 2.0) {
  run["figures"]["lost_after_s"] = 7.0;
  run["figures"]["flagged_after_s"] = flagged_after_s;
  run["summary"]["covariance"]["worst_sigma"] = worst_sigma;
}

Results judged_runs(const Results& runs) {
  Results results{{"version", "1"},
                  {"simulated", true},
                  {"duration_s", 80},
                  {"runs", runs},
                  {"subsets", {{"starts", 1}, {"seeds", 1}, {"only", "plant/real"}}}};
  judge_subsets(results);
  return results;
}

/// Runs of a drive whose wheels alone are 0.2 m off; `change` gets those with all sources, lidar and IMU, and lidar.
Results drive(double all_m, const std::function<void(Results& runs)>& change = {}) {
  Results runs{run_of("all", all_m), run_of("lidar and IMU", 0.02), run_of("lidar", 0.05)};
  if (change)
    change(runs);
  return runs;
}

Results row_of(double all_m, const std::function<void(Results& runs)>& change = {}) {
  const Results rows = judged_runs(drive(all_m, change))["subsets"]["rows"];
  EXPECT_EQ(rows.size(), 1U);
  return rows[0];
}

/// Makes every part bad, the wheels included.
void lose_all(Results& runs, const Results& flagged_after_s, double worst_sigma = 2.0) {
  for (Results& run : runs) {
    lose(run, flagged_after_s, worst_sigma);
    run["figures"]["odometry"]["wio"]["lost_after_s"] = 5.0;
  }
}

TEST(SubsetTable, HoldsUpToAFifthMoreThanTheBestSubset) {
  const Results row = row_of(0.0239);
  EXPECT_EQ(row["best"], "lidar and IMU");
  EXPECT_NEAR(row["ratio"].get<double>(), 1.195, 1e-9);
  EXPECT_EQ(row["verdict"], "holds");
  EXPECT_TRUE(row["holds"]);
  EXPECT_EQ(row_of(0.0241)["verdict"], "broken");
}

TEST(SubsetTable, BrokenNamesTheFactorAndTheSubset) {
  const Results row = row_of(0.1);
  EXPECT_EQ(row["verdict"], "broken");
  EXPECT_EQ(row["broken"], Results::array({"5.00 x lidar and IMU"}));
  EXPECT_FALSE(row["holds"]);
}

TEST(SubsetTable, OdometryAloneIsASubset) {
  const Results row = row_of(0.02, [](Results& runs) { runs[0]["figures"]["odometry"]["wio"]["mean_m"] = 0.01; });
  EXPECT_EQ(row["broken"], Results::array({"2.00 x wio alone"}));
  const Results silent = row_of(0.02, [](Results& runs) { runs[0]["figures"]["odometry"]["wio"] = nullptr; });
  EXPECT_EQ(silent["subsets"].size(), 3U);
}

TEST(SubsetTable, SubsetsWithAnUnsoundSourceDoNotCount) {
  const Results row = row_of(0.05, [](Results& runs) {
    runs[0]["unsound"] = {"imu", "wio"};
    runs[0]["figures"]["odometry"]["wio"]["mean_m"] = 0.01;
    runs[0]["sound"] = runs[1]["sound"] = false;
  });
  EXPECT_EQ(row["best"], "lidar");
  EXPECT_EQ(row["verdict"], "holds");
}

TEST(SubsetTable, WithoutASoundSubsetNothingIsCompared) {
  const Results row = row_of(0.05, [](Results& runs) {
    runs[0]["unsound"] = {"wio"};
    for (Results& run : runs)
      run["sound"] = false;
  });
  EXPECT_TRUE(row["best"].is_null());
  EXPECT_TRUE(row["ratio"].is_null());
  EXPECT_EQ(row["verdict"], "holds");
}

TEST(SubsetTable, ErrorsBelowAMillimetreAreEqual) {
  const Results row = row_of(0.001, [](Results& runs) { runs[1]["summary"]["ape_m"]["mean"] = 0.0; });
  EXPECT_EQ(row["ratio"], 1.0);
  EXPECT_TRUE(row["holds"]);
}

TEST(SubsetTable, LossOfAllSubsetsMustBeFlaggedAndWithinSigma) {
  const auto lost = [](const Results& flagged_after_s, double worst_sigma) {
    return row_of(0.02, [=](Results& runs) { lose_all(runs, flagged_after_s, worst_sigma); });
  };
  EXPECT_EQ(lost(1.0, 4.0)["verdict"], "flagged");
  EXPECT_TRUE(lost(1.0, 4.0)["holds"]);
  EXPECT_EQ(lost(1.1, 4.0)["broken"], Results::array({"lost, not flagged"}));
  EXPECT_EQ(lost(nullptr, 4.0)["broken"], Results::array({"lost, not flagged"}));
  EXPECT_EQ(lost(0.0, 4.1)["broken"], Results::array({"lost by 4.1 sigma"}));
}

TEST(SubsetTable, FlagDoesNotExcuseErrorsBeyondTheBestSubset) {
  const Results row = row_of(1.0, [](Results& runs) { lose_all(runs, 0.0); });
  EXPECT_EQ(row["verdict"], "broken");
  EXPECT_EQ(row["broken"], Results::array({"50.00 x lidar and IMU"}));
}

TEST(SubsetTable, NoFlagIsNeededIfAllSourcesAreNotLost) {
  const Results row = row_of(0.01, [](Results& runs) {
    lose_all(runs, nullptr);
    runs[0]["figures"]["lost_after_s"] = nullptr;
  });
  EXPECT_EQ(row["verdict"], "holds");
}

TEST(SubsetTable, OnlyFailureOfAllSourcesBreaksARow) {
  const auto fail = [](std::size_t which) {
    return row_of(0.05, [=](Results& runs) {
      runs[which].erase("summary");
      runs[which].erase("figures");
      runs[which]["failed"] = "ended by signal 11";
    });
  };
  EXPECT_EQ(fail(1)["best"], "lidar");
  EXPECT_EQ(fail(1)["verdict"], "holds");
  EXPECT_EQ(fail(1)["subsets"][1]["failed"], "ended by signal 11");
  EXPECT_EQ(fail(0)["verdict"], "failed");
  EXPECT_FALSE(fail(0)["holds"]);
}

TEST(SubsetTable, EachDriveAndViewIsARow) {
  Results runs = drive(0.02);
  for (const char* const key : {"view", "drive"}) {
    for (Results run : drive(0.1)) {
      if (key == std::string("view"))
        run["view_deg"] = 90;
      else
        run["drive"] = "mine/real 1";
      runs.push_back(run);
    }
  }
  const Results results = judged_runs(runs);
  const Results& rows = results["subsets"]["rows"];
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_TRUE(rows[0]["holds"]);
  EXPECT_EQ(rows[1]["view_deg"], 90);
  EXPECT_EQ(rows[2]["drive"], "mine/real 1");
  EXPECT_NE(subset_table(results).find(
                "Of 3 drives and views, 1 hold, 0 are flagged in time and within their "
                "covariance, 2 are broken (2 of them by more than a centimetre, or lost and not "
                "flagged), 0 failed. Error with all sources over that of the best sound subset: median 5.00, worst "
                "5.00 (plant/real 1, 90 degrees, lidar and IMU)."),
            std::string::npos)
      << subset_table(results);
}

TEST(SubsetTable, PageHasEverySubsetAndTheVerdict) {
  const std::string text = subset_table(judged_runs(drive(0.1, [](Results& runs) {
    runs[0]["unsound"] = {"wio"};
    runs[0]["sound"] = false;
    runs[2]["figures"]["tracking"] = 0.25;
  })));
  for (const char* const line :
       {"`locus-experiments --subsets --only \"plant/real\" --duration 80 --seeds 1`, version 1, a machine. ",
        ("| plant/real 1 | 360 | 100 | 300 | 2.0 | 100 % | lidar and IMU | 20.0 | 5.00 | **broken**: 5.00 x lidar and "
         "IMU |\n"),
        "| plant/real 1 | 360 | all (not sound) | 100 | 300 | 2.0 | 100 % |\n",
        "| plant/real 1 | 360 | **lidar and IMU** | 20.0 | 60.0 | 2.0 | 100 % |\n",
        "| plant/real 1 | 360 | lidar | 50.0 | 150 | 2.0 | 25 % |\n",
        "| plant/real 1 | 360 | wio alone (not sound) | 200 | 250 |  |  |\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
}

TEST(SubsetTable, PageHasTheReasonOfAFailedDrive) {
  const std::string text = subset_table(judged_runs(drive(0.1, [](Results& runs) {
    runs[0].erase("summary");
    runs[0].erase("figures");
    runs[0]["failed"] = "no packets";
  })));
  EXPECT_NE(text.find("| plant/real 1 | 360 | | | | | | | | **failed**: no packets |\n"), std::string::npos) << text;
  EXPECT_NE(text.find("| plant/real 1 | 360 | all | failed: no packets | | | |\n"), std::string::npos) << text;
}

} // namespace
} // namespace locus::experiments
