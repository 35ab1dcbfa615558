// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/fault_plan.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace locus::experiments {
namespace {

using Options = std::vector<std::string>;

struct CourseKind {
  std::string name, words;
  Options simulation; ///< except seed and duration
  std::string best_source = "wio";
};

const std::vector<CourseKind>& course_kinds() {
  static const std::vector<CourseKind> kinds{
      {"urban", "husky, plant", {"--world", "urban", "--robot", "husky"}},
      {"tunnel", "husky, mine", {"--world", "tunnel", "--robot", "husky"}},
      {"spot", "spot, plant", {"--world", "urban", "--robot", "spot"}, "vio"},
      {"two_lidars", "husky with two lidars, plant", {"--world", "urban", "--robot", "husky", "--lidars", "2"}},
      {"corridor", "husky, corridor of 100 m", {"--world", "corridor", "--robot", "husky"}},
      {kSlipCourse, "husky, plant", {"--world", "urban", "--robot", "husky"}}}; // plus the options of add_slip()
  return kinds;
}

const CourseKind& kind_of(const std::string& name) {
  return *std::ranges::find(course_kinds(), name, &CourseKind::name);
}

void add_without_faults(std::vector<FaultCase>& cases) {
  const auto add = [&](const char* course, double limit_m) {
    cases.push_back({kNoFault, "none", course, {}, Lasting::always, Demand::accurate, limit_m});
  };
  add("urban", 0.02);
  add("tunnel", 0.015);
  add("spot", 0.015);
  add("two_lidars", 0.02);
  cases.push_back(
      {kNoFault, "nothing to see along the way", "corridor", {}, Lasting::always, Demand::no_worse_than_wheels});
  cases.push_back({kNoFault, "wheels spin for 5 s", kSlipCourse, {}, Lasting::five_seconds, Demand::resisted, 0.05});
}

void add_losses(std::vector<FaultCase>& cases) {
  const auto add = [&](const char* configuration, const char* what, const char* course, const Options& lost) {
    cases.push_back({configuration, what, course, lost, Lasting::second_half, Demand::unharmed_or_flagged, 0.2});
  };
  for (const auto& [course, limit_m] : {std::pair{"urban", 0.3}, std::pair{"tunnel", 0.05}})
    cases.push_back({"lidar_alone",
                     "lidar alone from the start",
                     course,
                     {"wio:lost", "imu:lost"},
                     Lasting::always,
                     Demand::accurate_and_honest,
                     limit_m});
  for (const char* course : {"urban", "tunnel", "corridor"}) {
    add("wio_lost", "WIO lost", course, {"wio:lost"});
    add("wio_imu_lost", "WIO and IMU lost", course, {"wio:lost", "imu:lost"});
  }
  add("vio_lost", "VIO lost", "spot", {"vio:lost"});
  add("vio_kio_lost", "VIO and KIO lost", "spot", {"vio:lost", "kio:lost"});
  add("vio_kio_imu_lost", "VIO, KIO and IMU lost", "spot", {"vio:lost", "kio:lost", "imu:lost"});
}

void add_lidar_faults(std::vector<FaultCase>& cases) {
  for (const char* course : {"urban", "tunnel", "spot"})
    cases.push_back(
        {"lidar_gap", "no lidar for 10 s", course, {"all-lidars:lost"}, Lasting::ten_seconds, Demand::carried, 1.5});
  for (const char* lidar : {"top", "front"})
    cases.push_back({fmt::format("{}_gap", lidar),
                     fmt::format("lidar {} of two lost for 10 s", lidar),
                     "two_lidars",
                     {fmt::format("{}:lost", lidar)},
                     Lasting::ten_seconds,
                     Demand::unharmed,
                     0.1});
  cases.push_back({"front_never",
                   "lidar front of two never starts",
                   "two_lidars",
                   {"front:lost"},
                   Lasting::always,
                   Demand::unharmed,
                   0.1});
  for (const char* course : {"urban", "tunnel"}) {
    for (const char* kind : {"packet-loss", "reorder", "duplicate"})
      cases.push_back({fmt::format("lidar_{}", kind),
                       fmt::format("lidar {} 5 %", kind),
                       course,
                       {fmt::format("top:{}=5", kind)},
                       Lasting::always,
                       Demand::unharmed,
                       0.1});
  }
}

/// Adds clock faults of a lidar that still sends.
void add_lidar_clock_faults(std::vector<FaultCase>& cases) {
  const auto add = [&](const char* configuration, const char* what, const char* course, const char* fault,
                       Lasting lasting, int silent_sweeps) {
    cases.push_back({configuration, what, course, {fault}, lasting, Demand::unharmed, 0.2, silent_sweeps});
  };
  for (const char* course : {"urban", "tunnel"}) {
    cases.push_back(
        {"lidar_frozen", "lidar frozen", course, {"top:frozen"}, Lasting::five_seconds, Demand::carried, 1.5});
    add("lidar_late", "lidar late=0.2", course, "top:late=0.2", Lasting::five_seconds, 3);
    // The sensor reports minutes and seconds only: a step of an hour is invisible, half an hour is the largest.
    add("lidar_clock-step", "lidar clock-step=1800", course, "top:clock-step=1800", Lasting::five_seconds, 0);
    add("hour_rollover", "hour ends on the lidar's clock", course, "top:clock-step=2780", Lasting::always, 0);
  }
}

/// Adds motion sources that report wrong values for five seconds.
void add_source_faults(std::vector<FaultCase>& cases) {
  const Options any{"frozen", "nan", "late=0.2", "clock-step=3600"};
  Options odometry = any;
  odometry.insert(odometry.end(), {"jump=2", "covariance=10"});
  const auto add = [&](const std::string& source, const char* course, const Options& kinds) {
    for (const std::string& kind : kinds) {
      const std::string name = kind.substr(0, kind.find('='));
      cases.push_back({fmt::format("{}_{}", source, name),
                       fmt::format("{} {}", source, kind),
                       course,
                       {fmt::format("{}:{}", source, kind)},
                       Lasting::five_seconds,
                       Demand::unharmed,
                       0.2});
    }
  };
  add("wio", "urban", odometry);
  add("wio", "tunnel", odometry);
  add("vio", "spot", odometry);
  add("imu", "urban", any);
}

/// Returns the interval of the fault; for a permanent one, some seconds in the middle.
Interval interval_of(Lasting lasting, int duration_s) {
  const int half_s = duration_s / 2;
  switch (lasting) {
  case Lasting::second_half:
    return {half_s, duration_s};
  case Lasting::ten_seconds:
    return {half_s, half_s + 10};
  case Lasting::always:
  case Lasting::five_seconds:
    break;
  }
  return {half_s, half_s + 5};
}

Run run_of(const FaultCase& fault_case, int seed, int duration_s) {
  Run run{fault_course(fault_case.course, seed), fault_case.configuration, {}};
  run.watched = interval_of(fault_case.lasting, duration_s);
  for (const std::string& fault : fault_case.faults) {
    std::string spec = fault + '@';
    if (fault_case.lasting == Lasting::always)
      spec += '0';
    else if (fault_case.lasting == Lasting::second_half)
      spec += fmt::format("{}", run.watched->from_s);
    else
      spec += fmt::format("{}-{}", run.watched->from_s, run.watched->until_s);
    run.options.insert(run.options.end(), {"--fail", spec});
  }
  return run;
}

Course simulated(const Arguments& arguments, const std::string& name, const CourseKind& kind, int seed) {
  Course course = simulated_course(arguments, name, kind.simulation, seed);
  if (kind.name == kSlipCourse) {
    const Interval slip = interval_of(Lasting::five_seconds, arguments.duration_s);
    course.simulation.insert(course.simulation.end(), {"--slip", fmt::format("{}-{}", slip.from_s, slip.until_s)});
  }
  return course;
}

/// Uses seeds that no other course has.
void add_honesty_runs(Plan& plan, Arguments arguments) {
  constexpr int kFirstSeed = 101;
  arguments.duration_s = 60;
  static const std::array<CourseKind, 4> kKinds{{{"", "", {"--world", "urban", "--robot", "husky"}},
                                                 {"", "", {"--world", "tunnel", "--robot", "husky"}},
                                                 {"", "", {"--world", "urban", "--robot", "spot"}},
                                                 {"", "", {"--world", "tunnel", "--robot", "spot"}}}};
  for (int i = 0; i < arguments.honesty_runs; ++i) {
    const CourseKind& kind = kKinds[static_cast<std::size_t>(i) % kKinds.size()];
    plan.courses.push_back(simulated(arguments, honesty_course(i), kind, kFirstSeed + i));
    plan.runs.push_back({honesty_course(i), kNoFault, {}});
  }
}

} // namespace

std::vector<std::string> FaultCase::faulty() const {
  std::vector<std::string> names;
  for (const std::string& fault : faults)
    names.push_back(fault.substr(0, fault.find(':')));
  return names;
}

const std::vector<FaultCase>& fault_cases() {
  static const std::vector<FaultCase> cases = [] {
    std::vector<FaultCase> all;
    add_without_faults(all);
    add_losses(all);
    add_lidar_faults(all);
    add_lidar_clock_faults(all);
    add_source_faults(all);
    return all;
  }();
  return cases;
}

std::string describe_course(const std::string& kind) { return kind_of(kind).words; }

Course course_of_kind(const Arguments& arguments, const std::string& kind, int seed) {
  return simulated(arguments, fault_course(kind, seed), kind_of(kind), seed);
}

std::string fault_course(const std::string& kind, int seed) { return fmt::format("{}_{}", kind, seed); }

std::string best_motion_source(const std::string& kind) { return kind_of(kind).best_source; }

std::string honesty_course(int index) { return fmt::format("honesty_{}", index + 1); }

Plan plan_of_faults(const Arguments& arguments) {
  Plan plan;
  for (int seed = 1; seed <= arguments.seeds; ++seed) {
    for (const CourseKind& kind : course_kinds())
      plan.courses.push_back(course_of_kind(arguments, kind.name, seed));
    for (const FaultCase& fault_case : fault_cases())
      plan.runs.push_back(run_of(fault_case, seed, arguments.duration_s));
  }
  add_honesty_runs(plan, arguments);
  return plan;
}

} // namespace locus::experiments
