// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/accuracy_page.hpp"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "locus_experiments/accuracy_figures.hpp"
#include "locus_experiments/job_control.hpp"
#include "locus_experiments/measurement.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/recordings.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using Names = std::vector<std::string>;

/// Name of a run with all available sources.
constexpr const char* kAllSources = "all";

/// Lists the drives of --simulated: in a plant, in a mine and, walking, in the plant.
std::vector<Course> drives_of(const Arguments& arguments) {
  if (!arguments.simulated)
    return {};
  const auto drive = [&](const std::string& name, const char* world, const char* robot) {
    Course course = simulated_course(arguments, name, {"--world", world, "--robot", robot}, 1);
    course.name = "simulated/" + name; // avoids a clash with a recording's name
    return course;
  };
  return {drive("husky-plant", "urban", "husky"), drive("husky-mine", "tunnel", "husky"),
          drive("spot-plant", "urban", "spot")};
}

/// Returns a run with only `sources`: all others of `received` are lost from the start.
Run run_with(const Names& sources, const Names& received, const std::string& course, const char* configuration) {
  Run run{course, configuration, {}};
  run.shows_recording = true;
  for (const std::string& source : received) {
    if (std::ranges::find(sources, source) == sources.end())
      run.options.insert(run.options.end(), {"--fail", source + ":lost@0"});
  }
  return run;
}

/// Lists the further runs on a recording: with its IMU and with lidar alone, where these differ from the first.
std::vector<Run> further_runs(const Results& row) {
  const std::string course = row.at("course");
  const Names received = row.value("sources", Names{}), inertial = row.value("imus", Names{});
  std::vector<Run> runs;
  if (!inertial.empty() && inertial.size() < received.size())
    runs.push_back(run_with(inertial, received, course, "imu"));
  if (!received.empty())
    runs.push_back(run_with({}, received, course, "alone"));
  return runs;
}

/// Converts a row of Ninja's to a run of the page.
Results shown(Results row, const std::string& name, const std::filesystem::path& recording) {
  if (row.contains("failed"))
    return {{"sources", Names{}}, {"failed", readable(row.at("failed"), name, recording)}};
  for (const char* const key : {"course", "configuration", "imus", "receiver"})
    row.erase(key);
  return row;
}

/// Builds an entry of the page from the rows of its runs, the one with all sources first.
Results entry_of(const Course& course, const Results& rows) {
  const std::string name = course.simulation.empty() ? course.name : course.folder.filename().string();
  Results entry{{"recording", name}};
  if (!course.simulation.empty())
    entry["simulation"] = course.simulation;
  entry["receiver"] = nullptr;
  entry["runs"] = Results::array();
  for (const Results& row : rows) {
    if (row.at("course") != course.name)
      continue;
    if (row.at("configuration") == kAllSources)
      entry["receiver"] = row.value("receiver", Results{});
    entry["runs"].push_back(shown(row, name, course.folder));
  }
  return entry;
}

} // namespace

Results accuracy_of(const Arguments& arguments) {
  Plan plan;
  for (const FoundRecording& recording : find_recordings(arguments.recordings, arguments.output))
    plan.courses.push_back({recording.name, recording.where, {}});
  const std::size_t recordings = plan.courses.size();
  std::ranges::move(drives_of(arguments), std::back_inserter(plan.courses));
  if (plan.courses.empty())
    throw tools::Failure(tools::ExitStatus::failed,
                         fmt::format("{}: no recording, at any depth; looked for {}",
                                     fmt::join(Names(arguments.recordings.begin(), arguments.recordings.end()), ", "),
                                     kKindsOfRecordings));
  for (const Course& course : plan.courses)
    plan.runs.push_back(run_with({}, {}, course.name, kAllSources));
  Arguments first = arguments; // the courses are used again
  first.keep_captures = true;
  for (const Results& row : carry_out(plan, first))
    std::ranges::move(further_runs(row), std::back_inserter(plan.runs));
  const Results rows = carry_out(plan, arguments);
  Results results{{"version", LOCUS_VERSION},
                  {"machine", machine_name()},
                  {"jobs", arguments.jobs},
                  {"simulated", plan.courses.size() - recordings},
                  {"duration_s", arguments.duration_s},
                  {"places", Results::array()},
                  {"recordings", Results::array()}};
  for (const std::filesystem::path& place : arguments.recordings)
    results["places"].push_back(std::filesystem::absolute(place / "").parent_path().filename().string());
  for (const Course& course : plan.courses)
    results["recordings"].push_back(entry_of(course, rows));
  return results;
}

} // namespace locus::experiments
