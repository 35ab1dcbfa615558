// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/accuracy_table.hpp"

#include <gtest/gtest.h>

namespace locus::experiments {
namespace {

/// A faultless run over 100 m.
Results run() {
  const Results took{{"p50", 0.5}, {"p99", 2.0}};
  return {{"sources", {"wio", "imu"}},
          {"summary",
           {{"duration_s", 100.0},
            {"sweeps", {{"seen", 1000}, {"processed", 1000}, {"dropped", 0}, {"failed", 0}}},
            {"process_ms", took},
            {"process_cpu_ms", took},
            {"ape_m", {{"mean", 0.1}, {"max", 0.2}}},
            {"rpe_10m_percent", 0.3},
            {"end_drift_m", 0.9},
            {"covariance", {{"worst_sigma", 2.0}}}}},
          {"states", {{"tracking", 990}, {"degenerate", 10}}},
          {"claims",
           {{"farthest_at_first_m", 0.01},
            {"farthest_m", 70.0},
            {"most_turned_deg", 90.0},
            {"speed_mps", {{"median", 1.0}, {"max", 1.5}}}}},
          {"way", {{"way_m", 100.0}, {"percent", 0.7}, {"deg_per_100m", 0.1}}}};
}

std::string page_of(const Results& run, const Results& receiver = nullptr) {
  const Results recording{{"recording", "a/b"}, {"receiver", receiver}, {"runs", Results::array({run})}};
  return accuracy_table({{"version", "1"},
                         {"machine", "a machine"},
                         {"jobs", 2},
                         {"simulated", 0},
                         {"duration_s", 300},
                         {"places", {"data"}},
                         {"recordings", Results::array({recording})}});
}

bool has(const std::string& page, const std::string& text) { return page.find(text) != std::string::npos; }

TEST(AccuracyTable, RunHoldsWithinOnePercentOfTheDistance) {
  Results result = run();
  EXPECT_TRUE(what_does_not_hold(result).empty());
  result["summary"]["end_drift_m"] = 1.1;
  EXPECT_EQ(what_does_not_hold(result), std::vector<std::string>{"off by 1.10 m"});
  result["way"]["way_m"] = 120.0;
  EXPECT_TRUE(what_does_not_hold(result).empty());
  result["summary"]["ape_m"]["max"] = 1.3;
  EXPECT_EQ(what_does_not_hold(result), std::vector<std::string>{"off by 1.30 m"}) << "on the way";
}

TEST(AccuracyTable, ShortDistanceAllowsThreeCentimetres) {
  Results result = run();
  result["way"]["way_m"] = 0.0;
  result["summary"]["ape_m"]["max"] = 0.01;
  result["summary"]["end_drift_m"] = 0.029;
  EXPECT_TRUE(what_does_not_hold(result).empty());
  result["summary"]["end_drift_m"] = 0.031;
  EXPECT_EQ(what_does_not_hold(result).size(), 1U);
}

TEST(AccuracyTable, OverconfidenceAndLostSweepsDoNotHold) {
  Results result = run();
  result["summary"]["covariance"]["worst_sigma"] = 3.1;
  result["summary"]["sweeps"]["failed"] = 2;
  result["summary"]["sweeps"]["dropped"] = 1;
  EXPECT_EQ(what_does_not_hold(result), (std::vector<std::string>{"error beyond 3 sigma", "3 sweeps failed"}));
  EXPECT_TRUE(has(page_of(result), "**no**: error beyond 3 sigma; 3 sweeps failed |"));
  result["summary"]["sweeps"]["failed"] = 0;
  EXPECT_TRUE(has(page_of(result), "**no**: error beyond 3 sigma; 1 sweep failed |"));
}

TEST(AccuracyTable, TruthIsShownIfKnown) {
  const std::string page = page_of(run());
  EXPECT_TRUE(has(page, "| a/b | wio, imu | 100 | 0.100 | 0.200 | 0.300 | 0.700 | 0.900 | 0.900 | 2.00 | 1000, 0 | "
                        "tracking 990, degenerate 10 | 0.5, 2.0 | 0.5, 2.0 | yes |"))
      << page;
  EXPECT_FALSE(has(page, "Without truth")) << "no empty sections";
  EXPECT_FALSE(has(page, "KITTI's drives"));
}

TEST(AccuracyTable, SpeedIsShownWithThatOfTheReceiver) {
  Results result = run();
  result.erase("way");
  result["summary"]["lidars"]["front"]["model"] = "HDL-32E";
  const std::string page = page_of(result, {{"fixes", 1}, {"min_mps", 1.04}, {"median_mps", 1.04}, {"max_mps", 1.04}});
  EXPECT_TRUE(has(page, "| a/b, HDL-32E | wio, imu | 100.0 | 0.010, 70.0 | 90.0 | 1.00, 1.50 | 1.0 to 1.0, 1 fix |"))
      << page;
  EXPECT_FALSE(has(page, "With truth"));
}

TEST(AccuracyTable, SinglePoseHasNoSpeed) {
  Results result = run();
  result.erase("way");
  result["claims"]["speed_mps"] = nullptr;
  EXPECT_TRUE(has(page_of(result), "| 100.0 |  | |  |  | 1000, 0 |")) << page_of(result);
}

TEST(AccuracyTable, KittiIsShownWithPublishedResults) {
  Results result = run();
  result["summary"]["kitti_vertical_angle_added_deg"] = 0.205;
  EXPECT_TRUE(has(page_of(result), "0.205 degrees are added")) << page_of(result);
  EXPECT_TRUE(has(page_of(result), "CT-ICP 0.59 %"));
}

TEST(AccuracyTable, FailedRunIsARowWithTheReason) {
  const std::string page = page_of({{"sources", Results::array()}, {"failed", "no whole revolution"}});
  EXPECT_TRUE(has(page, "| a/b | no whole revolution |")) << page;
  EXPECT_TRUE(has(page, "`locus-experiments --accuracy data`, version 1, a machine. Recordings found: 1, of robots "
                        "or simulators, which the data do not distinguish."));
}

TEST(AccuracyTable, WarningIsListedOncePerRecording) {
  Results result = run();
  result["warnings"] = {"the IMU is upside down", "the IMU is upside down"};
  const std::string page = page_of(result);
  const std::size_t first = page.find("- a/b: the IMU is upside down\n");
  ASSERT_NE(first, std::string::npos) << page;
  EXPECT_EQ(page.find("upside down", first + 20), std::string::npos);
}

} // namespace
} // namespace locus::experiments
