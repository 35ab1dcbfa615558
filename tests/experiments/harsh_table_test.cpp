// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_table.hpp"

#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "locus_experiments/harsh_plan.hpp"

namespace locus::experiments {
namespace {

const std::string kOnly = "plant/real";

/// A faultless drive.
Results drive(Sensors sensors, int start) {
  const HarshCase plant = harsh_cases(kOnly).front();
  Results run{{"course", plant.course_name(1)},
              {"configuration", harsh_configuration(sensors, start)},
              {"machine", "a machine"}};
  run["summary"] = {{"largest_speed_mps", 1.5},
                    {"ape_m", {{"mean", 0.01}, {"max", 0.05}}},
                    {"covariance", {{"nees_10m", 6.0}, {"worst_sigma", 2.0}}}};
  run["harsh"] = {{"standing", start == 0},
                  {"true_mps", 1.2},
                  {"lost_after_s", nullptr},
                  {"flagged_after_s", nullptr},
                  {"said", Results::array()}};
  return run;
}

/// Ten drives with all sensors, the fourth of which is modified.
Results results_with(const std::function<void(Results& drive)>& make_worse) {
  Results runs = Results::array();
  for (int start = 0; start < kHarshStarts; ++start) {
    runs.push_back(drive(Sensors::all, start));
    if (start == 3)
      make_worse(runs.back());
  }
  Results results{
      {"version", "1"}, {"duration_s", kHarshCourse_s}, {"runs", runs}, {"harsh", {{"seeds", 1}, {"only", kOnly}}}};
  judge_harsh(results);
  return results;
}

Results row_with(const std::function<void(Results& drive)>& make_worse) {
  const Results rows = results_with(make_worse)["harsh"]["rows"];
  EXPECT_EQ(rows.size(), 1U) << "sensors without runs have no row";
  return rows[0];
}

Results broken_with(const std::function<void(Results& drive)>& make_worse) { return row_with(make_worse)["broken"]; }

TEST(HarshTable, RowSummarisesItsDrives) {
  const Results row = row_with([](Results& drive) {
    drive["summary"]["ape_m"] = {{"mean", 0.02}, {"max", 0.1}};
    drive["harsh"]["said"] = {"imu was lost"};
  });
  EXPECT_EQ(row["drives"], 10);
  EXPECT_EQ(row["standing"], 1);
  EXPECT_DOUBLE_EQ(row["median_m"].get<double>(), 0.01);
  EXPECT_DOUBLE_EQ(row["worst_m"].get<double>(), 0.1);
  EXPECT_EQ(row["said"], (Results{{{"text", "imu was lost"}, {"drives", 1}}}));
  EXPECT_TRUE(row["holds"]);
}

TEST(HarshTable, OneBadDriveBreaksARow) {
  EXPECT_EQ(broken_with([](Results& drive) { drive["summary"]["ape_m"]["max"] = 0.16; }),
            Results::array({"worst error"}));
  EXPECT_EQ(broken_with([](Results& drive) { drive["summary"]["covariance"]["worst_sigma"] = 4.1; }),
            Results::array({"sigma"}));
  EXPECT_EQ(broken_with([](Results& drive) { drive["summary"]["largest_speed_mps"] = 2.3; }),
            Results::array({"speed"}));
}

TEST(HarshTable, LostDriveMustBeFlaggedWithinASecond) {
  const auto lost = [](Results flagged_after_s) {
    return broken_with([=](Results& drive) {
      drive["harsh"]["lost_after_s"] = 7.0;
      drive["harsh"]["flagged_after_s"] = flagged_after_s;
    });
  };
  EXPECT_EQ(lost(nullptr), Results::array({"lost, not flagged"}));
  EXPECT_EQ(lost(1.1), Results::array({"lost, not flagged"}));
  EXPECT_EQ(lost(0.9), Results::array());
}

TEST(HarshTable, FailedDriveBreaksOnlyItsRow) {
  const Results row = row_with([](Results& drive) {
    drive = {{"course", drive["course"]}, {"configuration", drive["configuration"]}, {"failed", "ended by signal 11"}};
  });
  EXPECT_EQ(row["drives"], 9);
  EXPECT_EQ(row["failed"], 1);
  EXPECT_EQ(row["broken"], Results::array({"drives fail"}));
}

TEST(HarshTable, ShowsLostAndFlaggedDrives) {
  const std::string text = harsh_table(results_with([](Results& drive) {
    drive["summary"]["ape_m"]["max"] = 12.0;
    drive["harsh"]["lost_after_s"] = 7.0;
    drive["harsh"]["flagged_after_s"] = 2.5;
  }));
  EXPECT_NE(text.find("a machine. 0 of 1 rows hold."), std::string::npos) << text;
  EXPECT_NE(text.find("| plant | real | all | 10, 1 | 10.0 | 12000 | 2.0 | 6.0 | 1.5, 1.2 | 1, 1 within 2.5 s | "
                      "**no**: worst error, lost, not flagged |  |\n"),
            std::string::npos)
      << text;
}

} // namespace
} // namespace locus::experiments
