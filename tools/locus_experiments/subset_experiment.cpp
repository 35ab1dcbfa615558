// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/subset_experiment.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/accuracy_figures.hpp"
#include "locus_experiments/job_control.hpp"
#include "locus_experiments/recordings.hpp"
#include "locus_experiments/subset_plan.hpp"
#include "locus_experiments/subset_table.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using Names = std::vector<std::string>;

/// Recording with truth.
struct TrueRecording {
  FoundRecording found;
  int duration_s;
};

/// Searches the user's folders, and lists the recordings without truth in `without_truth`.
std::vector<TrueRecording> true_recordings(const Arguments& arguments, Names& without_truth) {
  std::vector<TrueRecording> recordings;
  for (FoundRecording& found : find_recordings(arguments.recordings, arguments.output)) {
    const std::vector<StampedPose> truth = truth_of(found.where);
    if (truth.empty())
      without_truth.push_back(found.name);
    else
      recordings.push_back({std::move(found), static_cast<int>(to_seconds(truth.back().stamp - truth.front().stamp))});
  }
  if (recordings.empty())
    throw tools::Failure(
        tools::ExitStatus::failed,
        fmt::format("--subsets: none of the {} recordings found has truth: put the true poses beside lidar.pcap as "
                    "gt.tum",
                    without_truth.size()));
  return recordings;
}

/// Returns the sources that a run with all of them received.
Sources sources_in(const Results& row, const std::filesystem::path& recording) {
  Sources sources;
  if (row.contains("failed"))
    return sources;
  const Results& summary = row.at("summary");
  for (const auto& lidar : summary.at("lidars").items())
    sources.lidars.push_back(lidar.key());
  const Names received = received_sources(summary);
  sources.imus = imus_among(received, recording);
  std::ranges::copy_if(received, std::back_inserter(sources.odometry), [&](const std::string& name) {
    return std::ranges::find(sources.imus, name) == sources.imus.end();
  });
  return sources;
}

/// Replays each recording once, to learn its sources.
SubsetCourses recorded_subsets(const Arguments& arguments, Names& without_truth) {
  const std::vector<TrueRecording> recordings = true_recordings(arguments, without_truth);
  SubsetCourses planned;
  Plan first;
  for (const auto& [found, duration_s] : recordings) {
    first.courses.push_back({found.name, found.where, {}});
    first.runs.push_back(subset_runs({found.name, found.name, 0, {}, {}, 0}).front().run);
  }
  const Results rows = carry_out(first, arguments);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const auto& [found, duration_s] = recordings[i];
    const Sources sources = sources_in(rows[i], found.where);
    for (const int start_s : starts_of(duration_s, arguments.starts)) {
      std::string name = found.name;
      if (arguments.starts > 1)
        name += fmt::format(", from {} s", start_s);
      planned.drives.push_back({std::move(name), found.name, start_s, sources, {}, 0});
    }
  }
  planned.courses = std::move(first.courses);
  return planned;
}

} // namespace

Results results_of_subsets(const Arguments& arguments, Results asked) {
  Names without_truth;
  SubsetCourses planned =
      arguments.recordings.empty() ? simulated_subsets(arguments) : recorded_subsets(arguments, without_truth);
  std::vector<SubsetRun> runs;
  for (const SubsetDrive& drive : planned.drives)
    std::ranges::move(subset_runs(drive), std::back_inserter(runs));
  Plan plan{std::move(planned.courses), {}};
  std::ranges::transform(runs, std::back_inserter(plan.runs), &SubsetRun::run);
  Results rows = carry_out(plan, arguments);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const SubsetRun& run = runs[i];
    rows[i].update({{"drive", run.drive},
                    {"view_deg", run.view_deg},
                    {"subset", run.subset},
                    {"sound", run.is_sound},
                    {"unsound", run.unsound}});
  }
  asked["subsets"]["without_truth"] = without_truth;
  asked["runs"] = std::move(rows);
  judge_subsets(asked);
  return asked;
}

} // namespace locus::experiments
