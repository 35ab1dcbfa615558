// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/compare.hpp"

#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "locus_experiments/matrix_plan.hpp"
#include "locus_replay/failure.hpp"
#include "replay/replay_run.hpp"

namespace locus::experiments {
namespace {

/// A row in the format of judge_faults().
Results fault_row(const std::string& configuration, double error_m, double worst_sigma = 2.0, bool holds = true) {
  return {{"fault", "a fault"},
          {"course", "urban"},
          {"configuration", configuration},
          {"broken", holds ? Results::array() : Results::array({"error too large"})},
          {"ape_mean_m", {{"without", 0.004}, {"with", error_m}}},
          {"sweeps", {{"lost", 0}, {"failed", 0}}},
          {"worst_sigma", worst_sigma},
          {"holds", holds}};
}

Results faults(const std::vector<Results>& rows) {
  return {{"version", "1"},
          {"duration_s", 60},
          {"runs", Results::array()},
          {"faults", {{"seeds", 1}, {"consistency_runs", 0}, {"rows", rows}, {"consistency", nullptr}}}};
}

class Compare : public testing::Test {
 protected:
  [[nodiscard]] ResultsBefore before(const Results& results) const {
    std::ofstream{folder_ / "before.json"} << results;
    return ResultsBefore(folder_ / "before.json");
  }
  [[nodiscard]] std::string page(const Results& was, const Results& is) const {
    return before(was).comparison_with(is);
  }
  [[nodiscard]] std::string error(const Results& was, const Results& is) const {
    try {
      before(was).check_is_of(is);
    } catch (const tools::Failure& failure) {
      return failure.what();
    }
    return "";
  }
  /// Returns the verdict on a row that differs only in these figures.
  [[nodiscard]] std::string verdict(double was_m, double is_m, double was_sigma = 2.0, double is_sigma = 2.0) const {
    const std::string text = page(faults({fault_row("a", was_m, was_sigma)}), faults({fault_row("a", is_m, is_sigma)}));
    const std::size_t end = text.find(" | urban/a |");
    const std::size_t begin = text.rfind('\n', end) + 3;
    return text.substr(begin, end - begin);
  }

  test::TemporaryFolder folder_;
};

bool contains_text(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(Compare, DifferencesCountBeyondAMillimetreAndATenth) {
  EXPECT_EQ(verdict(0.0040, 0.0049), "same") << "less than a millimetre";
  EXPECT_EQ(verdict(0.100, 0.109), "same") << "less than a tenth";
  EXPECT_EQ(verdict(0.0040, 0.0051), "**worse**");
  EXPECT_EQ(verdict(0.100, 0.111), "**worse**");
  EXPECT_EQ(verdict(0.0051, 0.0040), "better");
  EXPECT_EQ(verdict(0.004, 0.004, 2.0, 2.15), "same");
  EXPECT_EQ(verdict(0.004, 0.004, 2.0, 2.3), "**worse**");
}

TEST_F(Compare, RowIsWorseIfAnyFigureIs) {
  EXPECT_EQ(verdict(0.1, 0.01, 2.0, 4.0), "**worse**");
  EXPECT_EQ(verdict(0.01, 0.1, 4.0, 2.0), "**worse**");
}

TEST_F(Compare, HoldingOutweighsFigures) {
  const std::string lost = page(faults({fault_row("a", 0.0201)}), faults({fault_row("a", 0.0200, 2.0, false)}));
  EXPECT_TRUE(contains_text(lost, "| **worse** | urban/a | yes -> **no**: error too large | 20.1 -> 20.0 |")) << lost;
  EXPECT_TRUE(contains_text(lost, "1 worse, 0 better, 0 same")) << lost;
  EXPECT_TRUE(contains_text(lost, "1 no longer hold, 0 newly hold")) << lost;
  const std::string found = page(faults({fault_row("a", 0.02, 2.0, false)}), faults({fault_row("a", 0.04)}));
  EXPECT_TRUE(contains_text(found, "| better | urban/a | **no** -> yes | 20.0 -> 40.0 (+100 %) |")) << found;
}

TEST_F(Compare, WorstRowIsFirst) {
  const std::vector<Results> was{fault_row("same", 0.01), fault_row("better", 0.1), fault_row("worse", 0.01),
                                 fault_row("worst", 0.01), fault_row("breaks", 0.02)};
  const std::vector<Results> is{fault_row("same", 0.01), fault_row("better", 0.01), fault_row("worse", 0.02),
                                fault_row("worst", 0.5), fault_row("breaks", 0.02, 2.0, false)};
  const std::string text = page(faults(was), faults(is));
  std::size_t at = 0;
  for (const char* name : {"breaks", "worst", "worse", "same", "better"}) {
    const std::size_t here = text.find(std::string("| urban/") + name + " |");
    EXPECT_GT(here, at) << name << '\n' << text;
    at = here;
  }
  EXPECT_TRUE(contains_text(text, "5 rows: 3 worse, 1 better, 1 same, 1 of these with equal figures")) << text;
}

TEST_F(Compare, RowsOfOnlyOneResultAreNamed) {
  const std::string text =
      page(faults({fault_row("a", 0.1), fault_row("gone", 0.1)}), faults({fault_row("a", 0.1), fault_row("new", 0.1)}));
  EXPECT_TRUE(contains_text(text, "1 rows: 0 worse, 0 better, 1 same")) << text;
  EXPECT_TRUE(contains_text(text, "Only before, 1: urban/gone.")) << text;
  EXPECT_TRUE(contains_text(text, "Only after, 1: urban/new.")) << text;
}

TEST_F(Compare, RunWithoutAFormerFigureIsWorse) {
  const Results failed{{"fault", "a fault"},
                       {"course", "urban"},
                       {"configuration", "a"},
                       {"broken", {"seed 1 failed"}},
                       {"holds", false}};
  EXPECT_TRUE(
      contains_text(page(faults({fault_row("a", 0.1, 2.0, false)}), faults({failed})), "| **worse** | urban/a |"));
  EXPECT_TRUE(contains_text(page(faults({failed}), faults({failed})), "| same | urban/a |"));
}

TEST_F(Compare, CovariancesAreARowThatIsBestAtSix) {
  const auto with_nees = [](double nees, int runs) {
    Results results = faults({});
    results["faults"]["consistency"] = {{"runs", runs}, {"failed", 0}, {"nees_10m", nees}, {"holds", true}};
    return results;
  };
  EXPECT_TRUE(
      contains_text(page(with_nees(3.6, 100), with_nees(8.0, 100)), "| better | covariances, 100 runs | yes |"));
  EXPECT_TRUE(
      contains_text(page(with_nees(8.0, 100), with_nees(11.0, 100)), "| **worse** | covariances, 100 runs | yes |"));
  EXPECT_TRUE(contains_text(page(with_nees(8.0, 100), with_nees(8.0, 4)), "Only after, 1: covariances, 4 runs."));
}

/// One cell of the matrix and its reference run.
Results matrix(double error_m) {
  MatrixCell cell;
  cell.input = "wio";
  cell.what = "frozen";
  const Results figures{{"ape_m", {{"mean", error_m}}},
                        {"covariance", {{"worst_sigma", 2.0}}},
                        {"sweeps", {{"dropped", 0}, {"failed", 0}}}};
  const Results run{{"course", matrix_course()}, {"configuration", cell.configuration()}, {"summary", figures}};
  const Results judged{
      {"input", "wio"}, {"fault", "frozen"}, {"from_start", false}, {"broken", Results::array()}, {"holds", true}};
  const Results impossible{{"input", "top"}, {"fault", "NaN"}, {"from_start", false}, {"impossible", "no number"}};
  return {{"version", "1"}, {"duration_s", 60}, {"runs", {run}}, {"matrix", {{"cells", {judged, impossible}}}}};
}

TEST_F(Compare, MatrixCellHasTheFiguresOfItsRun) {
  const std::string text = page(matrix(0.004), matrix(0.008));
  EXPECT_TRUE(contains_text(text, "| **worse** | wio: frozen, mid-drive | yes | 4.0 -> 8.0 (+100 %) | 2.0 | 0 | 0 |"))
      << text;
  EXPECT_TRUE(contains_text(text, "1 rows: 1 worse")) << text;
}

/// A row in the format of judge_harsh().
Results harsh(double worst_m, int lost = 0, int flagged = 0, double claimed_mps = 1.2) {
  const Results row{
      {"course", "urban"},  {"imperfection", "late IMU"}, {"sensors", "all"}, {"median_m", 0.02}, {"worst_m", worst_m},
      {"worst_sigma", 1.0}, {"claimed_mps", claimed_mps}, {"true_mps", 1.0},  {"lost", lost},     {"flagged", flagged}};
  return {{"version", "1"},
          {"duration_s", 60},
          {"runs", Results::array()},
          {"harsh", {{"seeds", 1}, {"only", ""}, {"rows", {row}}}}};
}

/// A row in the format of judge_subsets(), of a recording.
Results subsets(double error_m, double ratio) {
  const Results all{{"subset", "all"}, {"mean_m", error_m}, {"worst_m", 0.2}, {"worst_sigma", 1.0}};
  const Results row{{"drive", "robot1"},          {"view_deg", 90}, {"subsets", {all}}, {"ratio", ratio},
                    {"broken", Results::array()}, {"holds", true}};
  return {{"version", "1"},
          {"duration_s", nullptr},
          {"runs", Results::array()},
          {"subsets", {{"starts", 1}, {"rows", {row}}}}};
}

TEST_F(Compare, RowsOfSubsetsAreKeyedByDriveAndView) {
  const std::string text = page(subsets(0.02, 1.0), subsets(0.04, 1.5));
  EXPECT_TRUE(contains_text(text, "| **worse** | robot1, 90 degrees | yes | 20.0 -> 40.0 (+100 %) | 200.0 | 1.0 | 1.00 "
                                  "-> 1.50 (+50 %) |"))
      << text;
  EXPECT_TRUE(contains_text(text, ", subsets. Before")) << text;
  Results more_starts = subsets(0.02, 1.0);
  more_starts["subsets"]["starts"] = 3;
  EXPECT_TRUE(contains_text(error(more_starts, subsets(0.02, 1.0)), "starts is 3 there and 1 here"));
}

TEST_F(Compare, HarshRowsAreKeyedByCourseImperfectionAndSensors) {
  const std::string text = page(harsh(0.1), harsh(124));
  EXPECT_TRUE(contains_text(text, "| **worse** | urban, late IMU, all |  | 20.0 | 100.0 -> 124000.0 (+123900 %) | 1.0 "
                                  "| 0 | 0 | 0.2 |"))
      << text;
}

TEST_F(Compare, UnreportedLossAndExcessSpeedMakeHarshRowsWorse) {
  const std::string lost = page(harsh(0.1), harsh(0.1, 1, 1));
  EXPECT_TRUE(contains_text(lost, "| **worse** | urban, late IMU, all |  | 20.0 | 100.0 | 1.0 | 0 -> 1 | 0 | 0.2 |"))
      << lost;
  const std::string unsaid = page(harsh(0.1, 2, 2), harsh(0.1, 2, 1));
  EXPECT_TRUE(contains_text(unsaid, "| **worse** | urban, late IMU, all |  | 20.0 | 100.0 | 1.0 | 2 | 0 -> 1 | 0.2 |"))
      << unsaid;
  const std::string fast = page(harsh(0.1), harsh(0.1, 0, 0, 9.0));
  EXPECT_TRUE(contains_text(fast, "| 1.0 | 0 | 0 | 0.2 -> 8.0 (+3900 %) |")) << fast;
  EXPECT_TRUE(contains_text(page(harsh(0.1), harsh(0.1, 0, 0, 0.7)), "| better | urban, late IMU, all |"))
      << "from 0.2 m/s too fast to none; a speed below that of the robot is no improvement";
  EXPECT_TRUE(contains_text(page(harsh(0.1, 0, 0, 0.9), harsh(0.1, 0, 0, 0.5)), "1 same, 1 of these with equal"));
}

TEST_F(Compare, OtherExperimentsAreAnError) {
  Results longer = faults({}), more_seeds = faults({}), paper = faults({}), real = faults({}), more_drives = harsh(0.1);
  longer["duration_s"] = 300;
  more_seeds["faults"]["seeds"] = 3;
  paper.erase("faults");
  real["realism"] = "real";
  more_drives["harsh"]["seeds"] = 3;
  EXPECT_EQ(error(faults({}), faults({})), "");
  EXPECT_TRUE(contains_text(error(longer, faults({})), "before.json: duration_s is 300 there and 60 here"));
  EXPECT_TRUE(contains_text(error(more_seeds, faults({})), "before.json: seeds is 3 there and 1 here"));
  EXPECT_TRUE(contains_text(error(more_drives, harsh(0.1)), "before.json: seeds is 3 there and 1 here"));
  EXPECT_EQ(error(harsh(0.1), harsh(0.1)), "");
  EXPECT_EQ(error(real, real), "");
  EXPECT_TRUE(contains_text(error(real, faults({})), "before.json: its courses are real, these are clean; compare"))
      << "results without this key are of clean courses";
  EXPECT_TRUE(contains_text(error(faults({}), real), "before.json: its courses are clean, these are real; compare"));
  EXPECT_TRUE(
      contains_text(error(matrix(0.1), faults({})), "before.json: contains no results of this experiment (faults)"));
  EXPECT_TRUE(contains_text(error(paper, faults({})), "before.json: contains no results of this experiment (faults)"));
  EXPECT_TRUE(contains_text(error(faults({}), paper), "--compare: the paper's experiments have no rows"));
}

TEST_F(Compare, FileWithoutResultsIsAnError) {
  EXPECT_THROW(ResultsBefore(folder_ / "nowhere.json"), tools::Failure);
  for (const Results& other : {Results::array(), Results{{"runs", 3}}, Results("text")})
    EXPECT_TRUE(contains_text(error(other, faults({})), "before.json: no results of locus-experiments")) << other;
  Results without_rows = faults({}), absurd_row = faults({{{"course", 7}}}), absurd_table = faults({});
  without_rows["faults"].erase("rows");
  absurd_table["faults"] = Results::array({1});
  for (const Results& other : {without_rows, absurd_row, absurd_table})
    EXPECT_TRUE(contains_text(error(other, faults({})), "before.json: its faults cannot be read"))
        << error(other, faults({}));
}

} // namespace
} // namespace locus::experiments
