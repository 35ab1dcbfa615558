// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/plan.hpp"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "config/config_yaml.hpp"

namespace locus::experiments {
namespace {

Arguments arguments() {
  Arguments arguments;
  arguments.output = "out";
  return arguments;
}

std::set<std::string> ids(const Plan& plan) {
  std::set<std::string> ids;
  for (const Run& run : plan.runs)
    EXPECT_TRUE(ids.insert(run.id()).second) << run.id() << " twice";
  return ids;
}

TEST(Plan, HasEveryRunOfThePapersTables) {
  const std::set<std::string> all = ids(make_plan(arguments()));
  for (const std::string course : {"alpha", "beta", "safety_research"}) {
    for (const char* configuration :
         {"locusd", "paper", "wio_imu_fail", "wio_fail", "lidar_drop", "pace_1cpu", "pace_2cpu"})
      EXPECT_TRUE(all.contains(course + '/' + configuration)) << course << ' ' << configuration;
  }
  for (const char* run : {"alpha/paper_fga", "alpha/imu_int", "alpha/no_int", "alpha/loam_feat", "alpha/rdf_off",
                          "alpha/vgf_off", "alpha/mdc_off", "spot_alpha/pace_1cpu", "spot_beta/pace_2cpu"})
    EXPECT_TRUE(all.contains(run)) << run;
}

TEST(Plan, LoamFeaturesAreExtractedInOneRunFromTheUnfilteredSweep) {
  const Plan plan = make_plan(arguments());
  const auto loam = std::ranges::find(plan.runs, true, &Run::loam_features);
  ASSERT_NE(loam, plan.runs.end());
  EXPECT_EQ(std::ranges::count(plan.runs, true, &Run::loam_features), 1);
  EXPECT_EQ(loam->id(), "alpha/loam_feat");
  std::vector<std::string> settings;
  std::ranges::copy_if(loam->options, std::back_inserter(settings),
                       [](const auto& option) { return option != "--set"; });
  const auto config = override_config(Config{}, settings);
  ASSERT_TRUE(config);
  EXPECT_FALSE(config->sweep.segment_filter.enabled);
  EXPECT_FALSE(config->sweep.voxel_filter.enabled);
  EXPECT_FALSE(config->sweep.random_filter.enabled);
}

TEST(Plan, RecordingsReplaceTheCourses) {
  Arguments fleet = arguments();
  fleet.recordings = {"/data/monday/robot1/", "/data/monday/robot2", "/data/tuesday/robot1"};
  const Plan plan = make_plan(fleet);
  ASSERT_EQ(plan.courses.size(), 3U);
  EXPECT_EQ(plan.courses[0].name, "robot1");
  EXPECT_EQ(plan.courses[1].name, "robot2");
  EXPECT_EQ(plan.courses[2].name, "robot1-2");
  EXPECT_TRUE(plan.courses[2].simulation.empty());
  EXPECT_EQ(plan.courses[2].folder, "/data/tuesday/robot1");
  EXPECT_EQ(ids(plan).size(), 12U);
}

TEST(Plan, PaperSettingsAreThoseOfTheShippedFile) {
  const auto husky = load_config(std::filesystem::path(LOCUS_CONFIG) / "husky.yaml");
  const auto paper = load_config(std::filesystem::path(LOCUS_CONFIG) / "paper-husky.yaml");
  ASSERT_TRUE(husky && paper);
  const auto overridden = override_config(*husky, paper_settings());
  ASSERT_TRUE(overridden) << overridden.error().front();
  EXPECT_EQ(print_config(*overridden), print_config(*paper));
}

} // namespace
} // namespace locus::experiments
