// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/results.hpp"

#include <vector>

#include <gtest/gtest.h>

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

TEST(Robustness, IsJudgedAgainstTheRunWithoutFailure) {
  Results all = results({paper_run("beta", "locusd", 0.1), paper_run("beta", "wio_imu_fail", 0.29),
                         paper_run("beta", "wio_fail", 0.31), paper_run("beta", "lidar_drop", 0.1, 200)});
  judge_robustness(all);
  ASSERT_EQ(all["robustness"].size(), 1U);
  EXPECT_EQ(all["robustness"][0]["wio_imu_fail"], "OK");
  EXPECT_EQ(all["robustness"][0]["wio_fail"], "Errors");
  EXPECT_EQ(all["robustness"][0]["lidar_drop"], "Stops");
}

TEST(Robustness, WithoutTheReferenceRunHasNoVerdict) {
  Results all = results(
      {paper_run("beta", "wio_fail", 0.3), {{"course", "alpha"}, {"configuration", "locusd"}, {"failed", "x"}}});
  judge_robustness(all);
  EXPECT_TRUE(all["robustness"].empty());
}

} // namespace
} // namespace locus::experiments
