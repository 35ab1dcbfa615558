// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_plan.hpp"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "faults/fault.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::experiments {
namespace {

Arguments fault_arguments() {
  Arguments arguments;
  arguments.output = "out";
  arguments.faults = true;
  arguments.duration_s = 120;
  arguments.seeds = 2;
  arguments.honesty_runs = 5;
  return arguments;
}

const Run& run_of(const Plan& plan, const std::string& id) { return *std::ranges::find(plan.runs, id, &Run::id); }

TEST(FaultPlan, RunsEachCaseOnEverySeedOnce) {
  const Plan plan = make_plan(fault_arguments());
  std::set<std::string> ids;
  for (const auto& run : plan.runs)
    EXPECT_TRUE(ids.insert(run.id()).second) << run.id() << " twice";
  EXPECT_EQ(plan.runs.size(), 2 * fault_cases().size() + 5);
  for (const FaultCase& fault_case : fault_cases()) {
    for (const int seed : {1, 2}) {
      EXPECT_TRUE(ids.contains(fault_course(fault_case.course, seed) + '/' + fault_case.configuration));
      EXPECT_TRUE(ids.contains(fault_course(fault_case.reference_course(), seed) + '/' + kNoFault));
    }
  }
}

TEST(FaultPlan, EveryFaultIsValidAndMeasuredWhileItLasts) {
  for (const auto& run : make_plan(fault_arguments()).runs) {
    for (std::size_t i = 1; i < run.options.size(); i += 2) {
      const auto fault = Fault::parse(run.options[i]);
      ASSERT_TRUE(fault) << fault.error();
      ASSERT_TRUE(run.watched) << run.id();
      EXPECT_TRUE(fault->from == Duration{} || fault->from == from_seconds(run.watched->from_s)) << run.options[i];
      EXPECT_TRUE(fault->until == Duration::max() || fault->until == from_seconds(run.watched->until_s));
    }
  }
}

TEST(FaultPlan, HourOfTheLidarEndsEarlyOnEveryCourse) {
  const auto row = std::ranges::find(fault_cases(), "hour_rollover", &FaultCase::configuration);
  const auto fault = Fault::parse(row->faults.front() + "@0");
  ASSERT_TRUE(fault) << fault.error();
  const Duration begins = sim::Start{}.stamp.time_since_epoch() + from_seconds(fault->value);
  const Duration until_the_hour = std::chrono::hours{1} - begins % std::chrono::hours{1};
  EXPECT_EQ(until_the_hour, std::chrono::seconds{20});
}

TEST(FaultPlan, FaultsBeginAtHalfTime) {
  const Plan plan = make_plan(fault_arguments());
  const auto options = [&](const char* id) { return run_of(plan, id).options; };
  EXPECT_EQ(options("urban_1/wio_lost"), (std::vector<std::string>{"--fail", "wio:lost@60"}));
  EXPECT_EQ(options("tunnel_2/lidar_gap"), (std::vector<std::string>{"--fail", "all-lidars:lost@60-70"}));
  EXPECT_EQ(options("spot_1/vio_jump"), (std::vector<std::string>{"--fail", "vio:jump=2@60-65"}));
  EXPECT_EQ(options("urban_1/lidar_alone"), (std::vector<std::string>{"--fail", "wio:lost@0", "--fail", "imu:lost@0"}));
  const Course& slip = *std::ranges::find(plan.courses, fault_course(kSlipCourse, 1), &Course::name);
  EXPECT_NE(std::ranges::find(slip.simulation, "60-65"), slip.simulation.end());
}

} // namespace
} // namespace locus::experiments
