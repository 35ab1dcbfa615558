// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_plan.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "faults/fault.hpp"
#include "locus_replay/failure.hpp"
#include "locus_sim/imperfections.hpp"

namespace locus::experiments {
namespace {

Arguments harsh_arguments(const std::string& only = "") {
  Arguments arguments;
  arguments.output = "out";
  arguments.harsh = true;
  arguments.duration_s = kHarshCourse_s;
  arguments.seeds = 2;
  arguments.only = only;
  return arguments;
}

double value_of(const std::vector<std::string>& options, const std::string& option) {
  const auto found = std::ranges::find(options, option);
  return found == options.end() ? -1 : std::stod(*(found + 1));
}

TEST(HarshPlan, EveryImperfectionRunsAloneOnceInHardUse) {
  for (const sim::NamedImperfection& one : sim::kImperfections) {
    const auto has_it = [&](const Imperfection& imperfection) {
      return value_of(imperfection.options, "--" + std::string(one.name)) == one.harsh;
    };
    EXPECT_EQ(std::ranges::count_if(imperfections(), has_it), 1) << one.name;
  }
}

TEST(HarshPlan, EveryCourseHasARealAndAHarshWorld) {
  std::set<std::string> courses;
  std::map<std::string, std::set<std::string>> driven;
  for (const HarshCase& harsh_case : harsh_cases("")) {
    courses.insert(harsh_case.course);
    driven[harsh_case.imperfection].insert(harsh_case.course);
  }
  EXPECT_EQ(courses.size(), 9U);
  EXPECT_EQ(driven["real"], courses);
  EXPECT_EQ(driven["harsh"], courses);
}

TEST(HarshPlan, GroupsRunAloneOnThreeCoursesAndTheVehicleWhereItFits) {
  std::map<std::string, std::set<std::string>> driven;
  for (const HarshCase& harsh_case : harsh_cases(""))
    driven[harsh_case.imperfection].insert(harsh_case.course);
  const std::set<std::string> usual{"plant", "corridor", "plant, spot"}, with_room{"plant", "field", "road, car"};
  for (const Imperfection& group : imperfections()) {
    if (group.courses.empty())
      continue;
    EXPECT_EQ(driven[group.name], group.name == "vehicle" ? with_room : usual) << group.name;
  }
}

TEST(HarshPlan, DrivesBeginAtTenPlacesOfTheCourseAndStayWithinIt) {
  const Plan plan = make_plan(harsh_arguments("plant/real"));
  std::map<std::string, std::set<double>> starts_s;
  for (const auto& run : plan.runs) {
    const double start_s = value_of(run.options, "--start"), duration_s = value_of(run.options, "--duration");
    EXPECT_EQ(duration_s, kHarshDrive_s) << run.id();
    EXPECT_LE(start_s + duration_s, kHarshCourse_s) << run.id();
    starts_s[run.course + run.configuration.substr(0, run.configuration.rfind('_'))].insert(start_s);
  }
  EXPECT_EQ(starts_s.size(), 2U * 3U) << "seeds and choices of sensors";
  for (const auto& [drives, starts] : starts_s)
    EXPECT_EQ(starts.size(), 10U) << drives;
}

TEST(HarshPlan, AbsentSensorsAreLostFromTheFirstSampleOn) {
  for (const auto& run : make_plan(harsh_arguments()).runs) {
    std::set<std::string> lost;
    for (std::size_t i = 0; i + 1 < run.options.size(); ++i) {
      if (run.options[i] != "--fail")
        continue;
      const auto fault = Fault::parse(run.options[i + 1]);
      ASSERT_TRUE(fault) << fault.error();
      EXPECT_EQ(fault->from, Duration{}) << run.id();
      lost.insert(fault->name);
    }
    const bool is_hand_held = run.course.find("hand-held") != std::string::npos;
    if (run.configuration.starts_with("all_")) {
      EXPECT_EQ(lost, std::set<std::string>{}) << run.id();
    } else {
      EXPECT_EQ(lost.contains("imu"),
                run.configuration.starts_with("lidar_") && !run.configuration.starts_with("lidar_and_IMU"))
          << run.id();
      EXPECT_EQ(lost.size() > (lost.contains("imu") ? 1U : 0U), !is_hand_held) << run.id();
    }
  }
}

TEST(HarshPlan, NamesOfCoursesAndRunsAreFileNames) {
  std::set<std::string> ids;
  for (const auto& run : make_plan(harsh_arguments()).runs) {
    EXPECT_TRUE(ids.insert(run.id()).second) << run.id() << " twice";
    EXPECT_EQ(run.course.find_first_of(" ,/"), std::string::npos) << run.course;
    EXPECT_EQ(run.configuration.find_first_of(" ,/"), std::string::npos) << run.configuration;
  }
}

TEST(HarshPlan, UnknownAndTooShortCoursesAreErrors) {
  EXPECT_THROW(make_plan(harsh_arguments("moon")), tools::Failure);
  Arguments brief = harsh_arguments();
  brief.duration_s = kHarshDrive_s;
  EXPECT_THROW(make_plan(brief), tools::Failure);
}

} // namespace
} // namespace locus::experiments
