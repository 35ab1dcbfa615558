// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_plan.hpp"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "faults/fault.hpp"

namespace locus::experiments {
namespace {

using Names = std::vector<std::string>;

Names names_of(const Sources& sources) {
  Names names;
  for (const Subset& subset : subsets_of(sources))
    names.push_back(subset.name);
  return names;
}

TEST(SubsetPlan, HasEachSubsetOnce) {
  EXPECT_EQ(names_of({{"top"}, {"wio"}, {"imu"}}), (Names{"all", "lidar and IMU", "lidar", "all but imu"}));
  EXPECT_EQ(names_of({{"top"}, {"vio", "kio"}, {"imu"}}),
            (Names{"all", "lidar and IMU", "lidar", "all but vio", "all but kio", "all but imu"}));
  EXPECT_EQ(names_of({{"top", "front"}, {"wio"}, {"imu"}}),
            (Names{"all", "lidar and IMU", "lidar", "all but top", "all but front", "all but imu"}));
  EXPECT_EQ(names_of({{"top"}, {}, {"imu"}}), (Names{"all", "lidar"}));
  EXPECT_EQ(names_of({{"top"}, {"wio"}, {}}), (Names{"all", "lidar"}));
  EXPECT_EQ(names_of({{"top"}, {}, {}}), Names{"all"});
}

TEST(SubsetPlan, EveryViewAndSubsetHasItsOwnName) {
  const SubsetDrive drive{"a drive", "course", 12, {{"top"}, {"wio"}, {"imu"}}, {"imu"}, 0.01};
  const std::vector<SubsetRun> runs = subset_runs(drive);
  ASSERT_EQ(runs.size(), 3U * 4U);
  std::set<std::string> ids;
  for (const SubsetRun& run : runs) {
    EXPECT_TRUE(ids.insert(run.run.id()).second) << run.run.id();
    EXPECT_EQ(run.run.configuration.find_first_of(" ,/"), std::string::npos) << run.run.configuration;
    EXPECT_EQ(run.is_sound, run.subset == "lidar" || run.subset == "all but imu") << run.subset;
    EXPECT_EQ(run.run.mounting_rad, 0.01);
    EXPECT_EQ(std::ranges::count(run.run.options, "--start"), 1);
  }
}

TEST(SubsetPlan, FaultsLastFromTheFirstPacketOn) {
  const SubsetDrive drive{"a drive", "course", 0, {{"top"}, {"wio"}, {"imu"}}, {}, 0};
  for (const SubsetRun& run : subset_runs(drive)) {
    std::set<std::string> lost;
    double view_deg = 360;
    for (std::size_t i = 0; i + 1 < run.run.options.size(); ++i) {
      if (run.run.options[i] != "--fail")
        continue;
      const auto fault = Fault::parse(run.run.options[i + 1]);
      ASSERT_TRUE(fault) << fault.error();
      EXPECT_EQ(fault->from, Duration{});
      EXPECT_EQ(fault->until, Duration::max());
      if (fault->kind == FaultKind::view)
        view_deg = fault->value;
      else
        lost.insert(fault->name);
    }
    EXPECT_EQ(view_deg, run.view_deg);
    EXPECT_EQ(lost.contains("wio"), run.subset.starts_with("lidar")) << run.subset;
    EXPECT_EQ(lost.contains("imu"), run.subset == "lidar" || run.subset == "all but imu") << run.subset;
  }
}

TEST(SubsetPlan, DrivesBeginInTheFirstHalf) {
  EXPECT_EQ(starts_of(80, 1), std::vector{0});
  EXPECT_EQ(starts_of(80, 4), (std::vector{0, 10, 20, 30}));
}

TEST(SubsetPlan, SourcesWorseThanRealOnesAreNotSound) {
  const auto unsound = [](const char* name) { return unsound_sources(harsh_cases(name).front()); };
  EXPECT_EQ(unsound("plant/real"), Names{});
  EXPECT_EQ(unsound("plant/harsh"), (Names{"wio", "imu"}));
  EXPECT_EQ(unsound("plant, spot/sources"), (Names{"vio", "kio", "imu"}));
  EXPECT_EQ(unsound("corridor/stamps"), (Names{"wio", "imu"}));
  for (const char* const world : {"plant/people", "plant/steam", "plant/mirrors", "plant/ranges", "plant/mounting"})
    EXPECT_EQ(unsound(world), Names{}) << world;
}

TEST(SubsetPlan, HarshCoursesRunWithEachSeedAndStart) {
  Arguments arguments;
  arguments.output = "out";
  arguments.subsets = true;
  arguments.duration_s = 80;
  arguments.only = "/real";
  arguments.seeds = 2;
  arguments.starts = 2;
  const SubsetCourses planned = simulated_subsets(arguments);
  EXPECT_EQ(planned.courses.size(), 9U * 2U);
  ASSERT_EQ(planned.drives.size(), 9U * 2U * 2U);
  EXPECT_EQ(planned.drives[1].name, "plant/real 1, from 20 s");
  EXPECT_EQ(planned.drives[1].course, planned.courses[0].name);
  std::set<std::string> names;
  for (const SubsetDrive& drive : planned.drives)
    EXPECT_TRUE(names.insert(drive.name).second) << drive.name;
  const auto of_two = std::ranges::find(planned.drives, "plant, two lidars/real 1, from 0 s", &SubsetDrive::name);
  ASSERT_NE(of_two, planned.drives.end());
  EXPECT_EQ(of_two->sources.lidars, (Names{"top", "front"}));
}

} // namespace
} // namespace locus::experiments
