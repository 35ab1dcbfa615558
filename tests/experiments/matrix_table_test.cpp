// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/matrix_table.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "locus_experiments/matrix_plan.hpp"

namespace locus::experiments {
namespace {

constexpr const char* kFrozen = "wio_frozen_mid";
constexpr const char* kNoLidar = "top_absent_start";

/// A faultless run.
Results run(const std::string& configuration) {
  Results run{{"course", matrix_course()}, {"configuration", configuration}, {"machine", "a machine"}};
  const Results source{{"received", 2000}, {"rejected", {{"frozen", 0}}}, {"health_changes", 0}};
  run["summary"] = {{"duration_s", 60.0},
                    {"packets", {{"top", {{"data", 45000}, {"rejected", {{"time", 0}}}}}}},
                    {"sweeps", {{"seen", 600}, {"processed", 600}, {"dropped", 0}, {"failed", 0}}},
                    {"sources", {{"wio", source}, {"imu", source}}},
                    {"ape_m", {{"mean", 0.002}, {"max", 0.008}}}};
  run["fault"] = {{"added_m", 0.0}, {"sources", {{"wio", {{"added_m", 0.1}}}}}};
  return run;
}

Results results_of(const std::vector<Results>& runs) {
  Results results{{"version", "1"}, {"duration_s", 60}, {"runs", runs}, {"matrix", Results::object()}};
  judge_matrix(results);
  return results;
}

/// Returns the only cell that was run.
Results judged(const Results& with) {
  const Results cells = results_of({run(kNoFault), with})["matrix"]["cells"];
  const auto cell = std::ranges::find_if(cells, [](const Results& each) { return each.contains("holds"); });
  return cell == cells.end() ? Results{} : *cell;
}

TEST(MatrixTable, CellHoldsIfTheFaultIsCounted) {
  Results frozen = run(kFrozen);
  frozen["summary"]["ape_m"]["mean"] = 0.004;
  EXPECT_EQ(judged(frozen)["broken"], Results::array({"not reported"}));
  frozen["summary"]["sources"]["wio"]["rejected"]["frozen"] = 77;
  EXPECT_TRUE(judged(frozen)["holds"]);
  EXPECT_EQ(judged(frozen)["shown"], Results::array({"wio.rejected.frozen 77"}));
}

TEST(MatrixTable, CountersOfAnotherInputMayShowAFault) {
  Results frozen = run(kFrozen);
  frozen["summary"]["sources"]["imu"]["health_changes"] = 2;
  EXPECT_EQ(judged(frozen)["shown"], Results::array({"imu.health_changes 2"}));
}

TEST(MatrixTable, VerdictOnASourceShowsAFault) {
  Results frozen = run(kFrozen);
  frozen["summary"]["sources"]["wio"]["verdict"] = "turns the other way";
  EXPECT_EQ(judged(frozen)["shown"], Results::array({"wio.verdict turns the other way"}));
}

TEST(MatrixTable, HarmlessFaultNeedsNoCounter) { EXPECT_TRUE(judged(run(kFrozen))["holds"]); }

TEST(MatrixTable, LargeErrorsAndLostSweepsBreakACell) {
  Results frozen = run(kFrozen);
  frozen["summary"]["sources"]["wio"]["rejected"]["frozen"] = 77;
  frozen["summary"]["ape_m"]["mean"] = 0.013;
  frozen["summary"]["sweeps"]["seen"] = 590;
  EXPECT_EQ(judged(frozen)["broken"], Results::array({"more error than allowed", "sweeps are lost"}));
  frozen["summary"]["sweeps"] = {{"seen", 600}, {"processed", 599}, {"dropped", 1}, {"failed", 0}};
  EXPECT_EQ(judged(frozen)["broken"][1], "sweeps are lost");
}

TEST(MatrixTable, FailedRunHoldsOnlyIfItMustBeRejected) {
  const auto ended = [](const char* configuration, const char* how) {
    return judged({{"course", matrix_course()}, {"configuration", configuration}, {how, "ended by signal 11"}});
  };
  EXPECT_EQ(ended(kFrozen, "failed")["broken"][0], "does not exit with 0: ended by signal 11");
  EXPECT_FALSE(ended(kNoLidar, "failed")["holds"]);
  EXPECT_TRUE(ended(kNoLidar, "refused")["holds"]);
  EXPECT_EQ(judged(run(kNoLidar))["broken"].back(), "is not rejected");
}

TEST(MatrixTable, IsOneLineForEachFaultOfAnInput) {
  const Results results = results_of({run(kNoFault), run("wio_frozen_start"), run(kFrozen)});
  const std::string text = matrix_table(results);
  EXPECT_NE(text.find("a machine. 2 of 2 cells hold; 6 more are not applicable."), std::string::npos) << text;
  EXPECT_NE(text.find("| wio | frozen | yes: +0.0 mm of 10.0 mm | nothing (no effect) | yes: +0.0 mm of 10.0 mm | "
                      "nothing (no effect) |\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("| top | NaN | not applicable: packets have no floating-point numbers | |"), std::string::npos)
      << text;
}

} // namespace
} // namespace locus::experiments
