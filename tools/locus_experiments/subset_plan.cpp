// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_plan.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "locus_sim/imperfections.hpp"

namespace locus::experiments {
namespace {

using Names = std::vector<std::string>;
using Size = double sim::Imperfections::*;

Names joined(Names names, const Names& more) {
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

/// Returns whether any of these imperfections is larger than in a real world.
bool exceeds_real(const sim::Imperfections& sizes, std::initializer_list<Size> imperfections) {
  const sim::Imperfections real = sim::imperfections_of(sim::Realism::real);
  return std::ranges::any_of(imperfections, [&](Size size) { return sizes.*size > real.*size; });
}

Names options_for(const Subset& subset, int view_deg, int start_s) {
  Names options;
  for (const std::string& source : subset.without)
    options.insert(options.end(), {"--fail", source + ":lost@0"});
  if (view_deg < 360)
    options.insert(options.end(), {"--fail", fmt::format("all-lidars:view={}@0", view_deg)});
  if (start_s > 0)
    options.insert(options.end(), {"--start", std::to_string(start_s)});
  return options;
}

Sources sources_of(const HarshCase& harsh_case) {
  const bool has_two_lidars = std::ranges::count(harsh_case.simulation, "--lidars") > 0;
  return {has_two_lidars ? Names{"top", "front"} : Names{"top"}, harsh_case.odometry, {"imu"}};
}

} // namespace

std::vector<Subset> subsets_of(const Sources& sources) {
  std::vector<Subset> subsets;
  std::set<std::set<std::string>> known;
  const auto add = [&](const std::string& name, const Names& without) {
    if (known.insert({without.begin(), without.end()}).second)
      subsets.push_back({name, without});
  };
  add(name_of(Sensors::all), {});
  const Names motion = joined(sources.odometry, sources.imus);
  if (!sources.imus.empty())
    add(name_of(Sensors::lidar_and_imu), sources.odometry);
  add(name_of(Sensors::lidar), motion);
  for (const std::string& source : sources.lidars.size() > 1 ? joined(sources.lidars, motion) : motion)
    add("all but " + source, {source});
  return subsets;
}

std::vector<std::string> unsound_sources(const HarshCase& harsh_case) {
  using sim::Imperfections;
  const auto& imperfection = *std::ranges::find(imperfections(), harsh_case.imperfection, &Imperfection::name);
  Names unsound;
  if (exceeds_real(imperfection.sizes, {&Imperfections::odometry_late_ms, &Imperfections::odometry_jitter_ms,
                                        &Imperfections::slip_bursts_per_min, &Imperfections::yaw_error_percent}))
    unsound = harsh_case.odometry;
  if (exceeds_real(imperfection.sizes,
                   {&Imperfections::imu_late_ms, &Imperfections::imu_jitter_ms, &Imperfections::gyro_scale_percent,
                    &Imperfections::gyro_walk_dps, &Imperfections::g_sensitivity_dps, &Imperfections::vibration_mps2}))
    unsound.emplace_back("imu");
  return unsound;
}

std::vector<int> starts_of(int duration_s, int count) {
  std::vector<int> starts_s;
  for (int i = 0; i < count; ++i)
    starts_s.push_back(duration_s / 2 * i / count);
  return starts_s;
}

std::vector<SubsetRun> subset_runs(const SubsetDrive& drive) {
  std::vector<SubsetRun> runs;
  for (const int view_deg : kViews_deg) {
    for (const Subset& subset : subsets_of(drive.sources)) {
      Run run{drive.course, file_name(fmt::format("{}_{}_{}", view_deg, subset.name, drive.start_s)),
              options_for(subset, view_deg, drive.start_s)};
      run.mounting_rad = drive.mounting_rad;
      run.shows_subset = true;
      const bool is_sound = std::ranges::all_of(
          drive.unsound, [&](const std::string& source) { return std::ranges::count(subset.without, source) > 0; });
      runs.push_back({std::move(run), drive.name, view_deg, subset.name, is_sound, drive.unsound});
    }
  }
  return runs;
}

SubsetCourses simulated_subsets(const Arguments& arguments) {
  SubsetCourses planned;
  for (int seed = 1; seed <= arguments.seeds; ++seed) {
    for (const HarshCase& harsh_case : named_harsh_cases(arguments.only)) {
      planned.courses.push_back(harsh_course(arguments, harsh_case, seed));
      for (const int start_s : starts_of(arguments.duration_s, arguments.starts)) {
        std::string name = fmt::format("{}/{} {}", harsh_case.course, harsh_case.imperfection, seed);
        if (arguments.starts > 1)
          name += fmt::format(", from {} s", start_s);
        planned.drives.push_back({std::move(name), planned.courses.back().name, start_s, sources_of(harsh_case),
                                  unsound_sources(harsh_case), kRadPerDeg * harsh_case.mounting_deg});
      }
    }
  }
  return planned;
}

} // namespace locus::experiments
