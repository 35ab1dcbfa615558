// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/harsh_plan.hpp"

#include <algorithm>
#include <span>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/pose.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;
using Options = std::vector<std::string>;

struct Drive {
  std::string name;
  Options simulation;
  std::vector<std::string> odometry;
  bool bare = false;
};

const std::vector<Drive>& drives() {
  static const std::vector<Drive> all{
      {"plant", {"--world", "urban", "--robot", "husky"}, {"wio"}},
      {"plant, two lidars", {"--world", "urban", "--robot", "husky", "--lidars", "2"}, {"wio"}},
      {"mine", {"--world", "tunnel", "--robot", "husky"}, {"wio"}},
      {"corridor", {"--world", "corridor", "--robot", "husky"}, {"wio"}, true},
      {"field", {"--world", "field", "--robot", "husky"}, {"wio"}},
      {"stairs, spot", {"--world", "stairs", "--robot", "spot"}, {"vio", "kio"}},
      {"plant, spot", {"--world", "urban", "--robot", "spot"}, {"vio", "kio"}},
      {"plant, hand-held", {"--world", "urban", "--robot", "handheld"}, {}},
      {"road, car", {"--world", "road", "--robot", "car"}, {"wio"}}};
  return all;
}

struct Group {
  std::string_view name;
  std::vector<std::string_view> imperfections;
  std::vector<std::string> courses{"plant", "corridor", "plant, spot"}; ///< used when tried alone
};

const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"mounting", {"mounting-deg", "mounting-mm"}},
      {"stamps", {"imu-late-ms", "imu-jitter-ms", "odometry-late-ms", "odometry-jitter-ms", "lidar-drift-ppm"}},
      {"ranges", {"beam-mrad", "laser-bias-mm", "incidence-bias-mm", "intensity-bias-mm", "laser-elevation-deg"}},
      {"own body", {"body-parts"}},
      {"sources",
       {"slip-bursts-per-min", "yaw-error-percent", "gyro-scale-percent", "gyro-walk-dps", "g-sensitivity-dps",
        "vibration-mps2"}},
      {"people", {"people"}},
      {"vehicle", {"vehicle-s-per-min"}, {"plant", "field", "road, car"}}, // the corridor is too narrow
      {"steam", {"steam-per-min"}},
      {"mirrors", {"wet-floor-percent", "glass-percent"}}};
  return all;
}

Imperfection alone(const Group& group) {
  Imperfection imperfection{std::string(group.name), {"--realism", "clean"}, {}, group.courses};
  for (const std::string_view name : group.imperfections) {
    const auto& one = *std::ranges::find(sim::kImperfections, name, &sim::NamedImperfection::name);
    imperfection.sizes.*one.size = one.harsh;
    imperfection.options.insert(imperfection.options.end(),
                                {fmt::format("--{}", name), fmt::format("{:g}", one.harsh)});
  }
  return imperfection;
}

bool is_tried(const Drive& drive, const Imperfection& imperfection) {
  return imperfection.courses.empty() || std::ranges::count(imperfection.courses, drive.name) > 0;
}

Options without(const HarshCase& harsh_case, Sensors sensors) {
  Options options;
  const auto lose = [&](const std::string& source) {
    options.insert(options.end(), {"--fail", fmt::format("{}:lost@0", source)});
  };
  if (sensors != Sensors::all)
    std::ranges::for_each(harsh_case.odometry, lose);
  if (sensors == Sensors::lidar)
    lose("imu");
  return options;
}

void add_runs(Plan& plan, const HarshCase& harsh_case, const std::string& course, int duration_s) {
  for (const Sensors sensors : harsh_case.sensors()) {
    for (int start = 0; start < kHarshStarts; ++start) {
      Run run{course, harsh_configuration(sensors, start), without(harsh_case, sensors)};
      const int start_s = start * (duration_s - kHarshDrive_s) / (kHarshStarts - 1);
      run.options.insert(run.options.end(), {"--start", std::to_string(start_s), "--duration",
                                             std::to_string(std::min(kHarshDrive_s, duration_s - start_s))});
      run.mounting_rad = kRadPerDeg * harsh_case.mounting_deg;
      plan.runs.push_back(std::move(run));
    }
  }
}

} // namespace

std::string file_name(std::string name) {
  std::erase(name, ',');
  std::ranges::replace(name, ' ', '_');
  return name;
}

std::string name_of(Sensors sensors) {
  switch (sensors) {
  case Sensors::all:
    return "all";
  case Sensors::lidar_and_imu:
    return "lidar and IMU";
  case Sensors::lidar:
    break;
  }
  return "lidar";
}

const std::vector<Imperfection>& imperfections() {
  static const std::vector<Imperfection> all = [] {
    std::vector<Imperfection> made;
    for (const sim::Realism realism : {sim::Realism::real, sim::Realism::harsh}) {
      const std::string level{sim::kRealismNames[static_cast<std::size_t>(realism)]};
      made.push_back({level, {"--realism", level}, sim::imperfections_of(realism), {}});
    }
    std::ranges::transform(groups(), std::back_inserter(made), alone);
    return made;
  }();
  return all;
}

std::vector<Sensors> HarshCase::sensors() const {
  if (odometry.empty())
    return {Sensors::lidar_and_imu, Sensors::lidar};
  return {Sensors::all, Sensors::lidar_and_imu, Sensors::lidar};
}

std::string HarshCase::course_name(int seed) const {
  return file_name(fmt::format("{}_{}_{}", course, imperfection, seed));
}

std::vector<HarshCase> harsh_cases(const std::string& only) {
  constexpr const char* kLongestHalt_s = "12"; // at every other corner: about half of the starts are at rest
  std::vector<HarshCase> cases;
  for (const Imperfection& imperfection : imperfections()) {
    for (const Drive& drive : drives()) {
      const bool is_named = fmt::format("{}/{}", drive.name, imperfection.name).find(only) != std::string::npos;
      if (!is_tried(drive, imperfection) || !is_named)
        continue;
      Options simulation = drive.simulation;
      simulation.insert(simulation.end(), {"--halts", kLongestHalt_s});
      simulation.insert(simulation.end(), imperfection.options.begin(), imperfection.options.end());
      cases.push_back({drive.name, imperfection.name, std::move(simulation), drive.odometry,
                       imperfection.sizes.mounting_deg, drive.bare});
    }
  }
  return cases;
}

std::vector<HarshCase> named_harsh_cases(const std::string& only) {
  std::vector<HarshCase> cases = harsh_cases(only);
  if (cases.empty())
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--only {}: no COURSE/IMPERFECTION contains that; examples are plant/real and "
                              "corridor/people; without --only all rows run",
                              only));
  return cases;
}

Course harsh_course(const Arguments& arguments, const HarshCase& harsh_case, int seed) {
  const std::string name = harsh_case.course_name(seed);
  Course course{name, arguments.output / "courses" / name, harsh_case.simulation};
  course.simulation.insert(course.simulation.end(),
                           {"--seed", std::to_string(seed), "--duration", std::to_string(arguments.duration_s)});
  course.has_true_map = false;
  return course;
}

std::string harsh_configuration(Sensors sensors, int start) {
  return file_name(fmt::format("{}_{}", name_of(sensors), start));
}

Plan plan_of_harsh(const Arguments& arguments) {
  if (arguments.duration_s <= kHarshDrive_s)
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("--duration {}: a harsh course must be longer than its drives of {} s",
                              arguments.duration_s, kHarshDrive_s));
  const std::vector<HarshCase> cases = named_harsh_cases(arguments.only);
  Plan plan;
  for (int seed = 1; seed <= arguments.seeds; ++seed) {
    for (const HarshCase& harsh_case : cases) {
      plan.courses.push_back(harsh_course(arguments, harsh_case, seed));
      add_runs(plan, harsh_case, plan.courses.back().name, arguments.duration_s);
    }
  }
  return plan;
}

} // namespace locus::experiments
