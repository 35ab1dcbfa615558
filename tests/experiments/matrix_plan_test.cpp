// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/matrix_plan.hpp"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "faults/fault.hpp"

namespace locus::experiments {
namespace {

TEST(MatrixPlan, EveryInputHasEveryFaultFromTheStartAndMidDrive) {
  std::set<std::string> inputs, names;
  const std::vector<MatrixCell> cells = matrix_cells(120);
  for (const MatrixCell& cell : cells) {
    inputs.insert(cell.input);
    EXPECT_TRUE(names.insert(cell.configuration()).second) << cell.configuration() << " twice";
    EXPECT_NE(cell.faults.empty(), cell.impossible.empty()) << cell.configuration();
  }
  EXPECT_EQ(inputs, (std::set<std::string>{"top", "top.position", "wio", "imu"}));
  EXPECT_EQ(cells.size(), 4U * 12U * 2U);
  EXPECT_EQ(std::ranges::count(cells, true, &MatrixCell::from_start), 48);
  EXPECT_LE(std::ranges::count_if(cells, [](const MatrixCell& cell) { return cell.faults.empty(); }), 6);
}

TEST(MatrixPlan, EveryPossibleCellRunsWithFaultsOfReplay) {
  Arguments arguments;
  arguments.output = "out";
  arguments.fault_matrix = true;
  arguments.duration_s = 120;
  const Plan plan = make_plan(arguments);
  EXPECT_EQ(plan.courses.size(), 1U);
  EXPECT_EQ(plan.runs.front().configuration, kNoFault);
  for (const MatrixCell& cell : matrix_cells(120)) {
    const auto run = std::ranges::find(plan.runs, cell.configuration(), &Run::configuration);
    ASSERT_EQ(run != plan.runs.end(), cell.impossible.empty()) << cell.configuration();
    for (const std::string& spec : cell.faults) {
      const auto fault = Fault::parse(spec);
      ASSERT_TRUE(fault) << fault.error();
      EXPECT_EQ(fault->name, cell.input);
      EXPECT_NE(std::ranges::find(run->options, spec), run->options.end());
      EXPECT_GE(fault->from, from_seconds(cell.lasting.from_s));
      EXPECT_TRUE(fault->until == Duration::max() || fault->until <= from_seconds(cell.lasting.until_s));
    }
  }
}

TEST(MatrixPlan, TemporaryLossLastsAMinute) {
  const std::vector<MatrixCell> cells = matrix_cells(120);
  const auto specs = [&](const char* name) {
    return std::ranges::find(cells, name, &MatrixCell::configuration)->faults;
  };
  EXPECT_EQ(specs("wio_absent__then_back_start"), std::vector<std::string>{"wio:lost@0-60"});
  EXPECT_EQ(specs("wio_absent__then_back_mid"), std::vector<std::string>{"wio:lost@40-100"});
  EXPECT_EQ(specs("wio_absent_mid"), std::vector<std::string>{"wio:lost@40"});
  EXPECT_EQ(specs("imu_frozen_mid"), std::vector<std::string>{"imu:frozen@40-100"});
}

} // namespace
} // namespace locus::experiments
