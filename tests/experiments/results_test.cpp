// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/results.hpp"

#include <fstream>
#include <vector>

#include <gtest/gtest.h>

#include "locus_replay/failure.hpp"
#include "replay/replay_run.hpp"

namespace locus::experiments {
namespace {

Results paper_run(const std::string& course, const std::string& configuration, double max_ape_m, double silent_s = 0) {
  return {{"course", course},
          {"configuration", configuration},
          {"summary", {{"ape_m", {{"max", max_ape_m}}}}},
          {"position_error", Results::object()},
          {"silent_at_end_s", silent_s}};
}

Results results(const std::vector<Results>& runs) {
  return {{"version", "1"}, {"simulated", true}, {"duration_s", 300}, {"runs", runs}};
}

std::filesystem::path saved(const std::filesystem::path& folder, const Results& results) {
  std::filesystem::create_directories(folder);
  std::ofstream{folder / "results.json"} << results;
  return folder;
}

std::string error_of_merging(const std::vector<std::filesystem::path>& folders) {
  try {
    merged(folders);
  } catch (const tools::Failure& failure) {
    return failure.what();
  }
  return "";
}

TEST(Robustness, IsJudgedBesideTheRunWithoutFailure) {
  Results all = results({paper_run("beta", "locusd", 0.1), paper_run("beta", "wio_imu_fail", 0.29),
                         paper_run("beta", "wio_fail", 0.31), paper_run("beta", "lidar_drop", 0.1, 200)});
  judge_robustness(all);
  ASSERT_EQ(all["robustness"].size(), 1U);
  EXPECT_EQ(all["robustness"][0]["wio_imu_fail"], "OK");
  EXPECT_EQ(all["robustness"][0]["wio_fail"], "Errors");
  EXPECT_EQ(all["robustness"][0]["lidar_drop"], "Stops");
}

TEST(Robustness, WithoutTheRunToCompareWithThereIsNoVerdict) {
  Results all = results(
      {paper_run("beta", "wio_fail", 0.3), {{"course", "alpha"}, {"configuration", "locusd"}, {"failed", "x"}}});
  judge_robustness(all);
  EXPECT_TRUE(all["robustness"].empty());
}

TEST(Merge, PutsTheRunsOfShardsTogether) {
  const test::TemporaryFolder folder;
  const auto one = saved(folder / "1", results({paper_run("beta", "locusd", 0.1)}));
  const auto two = saved(folder / "2", results({paper_run("beta", "wio_fail", 0.1)}));
  const Results all = merged({one, two});
  EXPECT_EQ(all["runs"].size(), 2U);
  EXPECT_EQ(all["robustness"][0]["wio_fail"], "OK") << "judged across shards";
}

TEST(Merge, KeepsTheOrderOfTheWholePlan) {
  const test::TemporaryFolder folder;
  const auto at = [](std::size_t place, const std::string& configuration) {
    Results result = paper_run("beta", configuration, 0.1);
    result["place"] = place;
    return result;
  };
  const auto one = saved(folder / "1", results({at(0, "a"), at(2, "c")}));
  const auto two = saved(folder / "2", results({at(1, "b"), at(3, "d")}));
  const Results all = merged({two, one});
  std::string order;
  for (const Results& each : all["runs"])
    order += each["configuration"].get<std::string>();
  EXPECT_EQ(order, "abcd");
}

TEST(Merge, RefusesWhatDoesNotBelongTogether) {
  const test::TemporaryFolder folder;
  const auto one = saved(folder / "1", results({paper_run("beta", "locusd", 0.1)}));
  Results longer = results({paper_run("beta", "wio_fail", 0.1)});
  longer["duration_s"] = 600;
  EXPECT_NE(error_of_merging({one, saved(folder / "2", longer)}).find("duration_s differs"), std::string::npos);
  EXPECT_NE(error_of_merging({one, one}).find("beta/locusd is in another folder too"), std::string::npos);
  EXPECT_NE(error_of_merging({folder / "none"}).find("no results of locus-experiments"), std::string::npos);
  EXPECT_NE(error_of_merging({saved(folder / "3", Results::array())}).find("no results"), std::string::npos);
}

} // namespace
} // namespace locus::experiments
