// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/plan.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "locus_experiments/fault_plan.hpp"
#include "locus_experiments/harsh_plan.hpp"
#include "locus_experiments/matrix_plan.hpp"

namespace locus::experiments {
namespace {

using Options = std::vector<std::string>;

const std::string kFlatGround = "flat_ground=auto"; ///< the paper's II-C: by the IMU

Options set(const Options& settings) {
  Options options;
  for (const std::string& setting : settings)
    options.insert(options.end(), {"--set", setting});
  return options;
}

Options paper_with(const Options& settings) {
  Options all = paper_settings();
  all.insert(all.end(), settings.begin(), settings.end());
  return set(all);
}

Options with(Options options, const Options& more) {
  options.insert(options.end(), more.begin(), more.end());
  return options;
}

/// Adds the runs of Table II, which are also the references of Table III. The paper does not assume flat ground in the
/// tunnel.
void add_accuracy(Plan& plan, const std::string& course, bool flat) {
  plan.runs.push_back({course, "locusd", {}});
  plan.runs.push_back({course, "paper", paper_with({})});
  if (flat) {
    plan.runs.push_back({course, "locusd_fga", set({kFlatGround})});
    plan.runs.push_back({course, "paper_fga", paper_with({kFlatGround})});
  }
}

/// Adds the runs of Table III: failures after a third of the course, as in the paper after 1200 s of 3600 s.
void add_robustness(Plan& plan, const std::string& course, int duration_s) {
  constexpr int kLidarGap_s = 10;
  const int fails_s = duration_s / 3;
  plan.runs.push_back({course,
                       "wio_imu_fail",
                       {"--fail", fmt::format("wio:lost@{}", fails_s), "--fail", fmt::format("imu:lost@{}", fails_s)}});
  plan.runs.push_back({course, "wio_fail", {"--fail", fmt::format("wio:lost@{}", fails_s)}});
  plan.runs.push_back(
      {course, "lidar_drop", {"--fail", fmt::format("all-lidars:lost@{}-{}", fails_s, fails_s + kLidarGap_s)}});
}

/// Adds the runs of Fig. 3. Its baseline is paper_fga and its fga_off is paper.
void add_ablation(Plan& plan, const std::string& course) {
  const Options baseline = paper_with({kFlatGround});
  const Options no_wio{"--fail", "wio:lost@0"}, no_imu{"--fail", "imu:lost@0"};
  plan.runs.push_back({course, "imu_int", with(baseline, no_wio)});
  plan.runs.push_back({course, "no_int", with(with(baseline, no_wio), no_imu)});
  plan.runs.push_back({course, "loam_feat",
                       paper_with({kFlatGround, "voxel_filter.enabled=false", "random_filter.enabled=false"}), 0,
                       true});
  plan.runs.push_back({course, "rdf_off", paper_with({kFlatGround, "random_filter.enabled=false"})});
  plan.runs.push_back({course, "vgf_off", paper_with({kFlatGround, "voxel_filter.enabled=false"})});
  plan.runs.push_back({course, "mdc_off", paper_with({kFlatGround, "motion_correction=false"})});
}

/// Adds the runs of Fig. 6, Table V and the load of Table II.
void add_pace(Plan& plan, const std::string& course, int pace_s) {
  for (const int cpus : {1, 2})
    plan.runs.push_back({course,
                         fmt::format("pace_{}cpu", cpus),
                         {"--realtime", "--threads", std::to_string(cpus), "--duration", std::to_string(pace_s)},
                         cpus});
}

Plan plan_of_paper(const Arguments& arguments) {
  Plan plan;
  const auto add_course = [&](const char* name, const char* world, const char* robot, int seed) {
    const char* const lidars = std::string_view{robot} == "husky" ? "2" : "1";
    plan.courses.push_back(
        simulated_course(arguments, name, {"--world", world, "--robot", robot, "--lidars", lidars}, seed));
  };
  add_course("alpha", "urban", "husky", 1);
  add_course("beta", "urban", "husky", 2);
  add_course("safety_research", "tunnel", "husky", 1);
  add_course("spot_alpha", "urban", "spot", 1);
  add_course("spot_beta", "urban", "spot", 2);
  add_accuracy(plan, "alpha", true);
  add_accuracy(plan, "beta", true);
  add_accuracy(plan, "safety_research", false);
  for (const std::string course : {"alpha", "beta", "safety_research"})
    add_robustness(plan, course, arguments.duration_s);
  add_ablation(plan, "alpha");
  for (const Course& course : plan.courses)
    add_pace(plan, course.name, std::min(arguments.pace_s, arguments.duration_s));
  return plan;
}

/// Names a recording after its folder, numbered if another has the same name.
std::string name_of(const std::filesystem::path& recording, const std::vector<Course>& others) {
  const std::filesystem::path folder = std::filesystem::absolute(recording / "").parent_path();
  std::string name = folder.filename().string();
  const auto taken = [&](const Course& other) { return other.name == name; };
  for (int count = 2; std::ranges::any_of(others, taken); ++count)
    name = fmt::format("{}-{}", folder.filename().string(), count);
  return name;
}

Plan plan_of_recordings(const Arguments& arguments) {
  Plan plan;
  for (const std::filesystem::path& recording : arguments.recordings) {
    plan.courses.push_back({name_of(recording, plan.courses), recording, {}});
    plan.runs.push_back({plan.courses.back().name, "locusd", {}});
    plan.runs.push_back({plan.courses.back().name, "paper", paper_with({})});
    add_pace(plan, plan.courses.back().name, arguments.pace_s);
  }
  return plan;
}

} // namespace

const std::vector<std::string>& paper_settings() {
  static const std::vector<std::string> settings{"fusion=queue",
                                                 "no_source_prior=identity",
                                                 "motion_correction=true",
                                                 "segment_filter.enabled=false",
                                                 "voxel_filter={enabled: true, leaf_m: 0.1}",
                                                 "random_filter={enabled: true, keep: 0.1}",
                                                 "scan_to_scan={mode: always, max_iterations: 20}",
                                                 "scan_to_submap.max_iterations=20",
                                                 "map={keyframe_m: 1, keyframe_deg: 30}",
                                                 "threads=4"};
  return settings;
}

Course simulated_course(const Arguments& arguments, const std::string& name, Options simulation, int seed) {
  for (const std::string& word : {std::string("--seed"), std::to_string(seed), std::string("--duration"),
                                  std::to_string(arguments.duration_s), std::string("--realism"), arguments.realism})
    simulation.push_back(word);
  return {name, arguments.output / "courses" / name, std::move(simulation)};
}

Plan make_plan(const Arguments& arguments) {
  if (arguments.faults)
    return plan_of_faults(arguments);
  if (arguments.fault_matrix)
    return plan_of_matrix(arguments);
  if (arguments.harsh)
    return plan_of_harsh(arguments);
  return arguments.recordings.empty() ? plan_of_paper(arguments) : plan_of_recordings(arguments);
}

} // namespace locus::experiments
