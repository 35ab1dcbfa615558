// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/accuracy_page.hpp"

#include <algorithm>
#include <exception>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "accuracy/trajectory_accuracy.hpp"
#include "config/config_yaml.hpp"
#include "drivers/files/capture_folder.hpp"
#include "locus_experiments/accuracy_figures.hpp"
#include "locus_experiments/child_process.hpp"
#include "locus_experiments/conductor.hpp"
#include "locus_experiments/measurement.hpp"
#include "locus_replay/failure.hpp"

namespace locus::experiments {
namespace {

using Names = std::vector<std::string>;
using std::filesystem::path;

/// How much faster than the drive the simulation goes, roughly: for the progress bar.
constexpr double kSimulationSpeed = 5;

/// Of kind imu, by the configuration that locus-replay takes.
std::set<std::string> imus_of(const path& recording) {
  Config config;
  if (const auto folder = CaptureFolder::find(recording); folder && !folder->first_config().empty()) {
    if (auto loaded = load_config(folder->first_config()))
      config = *std::move(loaded);
  }
  std::set<std::string> names;
  for (const MotionSourceOptions& source : config.motion_sources) {
    if (source.kind == SourceKind::imu)
      names.insert(source.name);
  }
  return names;
}

/// Of a run that is over.
Names heard_in(const Results& run) {
  Names names;
  for (const auto& [name, source] : run.at("summary").at("sources").items()) {
    if (source.at("received") > 0)
      names.push_back(name);
  }
  return names;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

/// As a line for a page: of the recording, with neither the program nor where on this machine it lies.
std::string readable(const std::string& said, const FoundRecording& recording) {
  constexpr std::string_view kProgram = "locus-replay: ";
  std::string line = said.starts_with(kProgram) ? said.substr(kProgram.size()) : said;
  line = replaced(line, recording.where.string(), recording.name);
  return line.starts_with(recording.name + ": ") ? line.substr(recording.name.size() + 2) : line;
}

Names warnings_in(const path& log, const FoundRecording& recording) {
  constexpr std::string_view kWarning = "locus-replay: warning: ";
  std::ifstream stream{log};
  Names warnings;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with(kWarning))
      warnings.push_back(readable(line.substr(kWarning.size()), recording));
  }
  return warnings;
}

Results to_json(const WayDrift& drift) {
  Results json{{"way_m", drift.way_m}, {"percent", nullptr}, {"deg_per_100m", nullptr}};
  if (drift.percent) {
    json["percent"] = *drift.percent;
    json["deg_per_100m"] = *drift.deg_per_100m;
  }
  return json;
}

/// What the files say that a run has left.
Results figures_of(const FoundRecording& recording, const path& folder) {
  Results run{{"summary", read_json(folder / "summary.json")}};
  if (run.at("summary").at("sweeps").at("seen") == 0)
    return {{"failed", "it holds no whole turn of a lidar"}};
  const auto trajectory = tools::value_or_fail(read_trajectory(folder / "odometry.tum"), tools::ExitStatus::failed);
  run["states"] = states_in(folder / "odometry.csv");
  run["claims"] = claims_of(trajectory);
  if (const auto drift = way_drift(trajectory, truth_of(recording.where)))
    run["way"] = to_json(*drift);
  run["warnings"] = warnings_in(folder / "log", recording);
  return run;
}

/// One run, in which the sources that are `silent` say nothing.
Results replayed(const std::string& replay, const FoundRecording& recording, const Names& silent, const path& folder) {
  try {
    std::filesystem::create_directories(folder);
    Names command{replay, "--quiet", "--threads", "1", "-o", folder.string()};
    for (const std::string& source : silent)
      command.insert(command.end(), {"--fail", source + ":lost@0"});
    command.push_back(recording.where.string());
    const auto problem = run_program(command, folder / "log");
    return problem ? Results{{"failed", readable(*problem, recording)}} : figures_of(recording, folder);
  } catch (const std::exception& error) {
    return {{"failed", readable(error.what(), recording)}};
  }
}

/// All runs on a recording.
Results runs_on(const std::string& replay, const FoundRecording& recording, const path& folder) {
  Results runs = Results::array();
  const auto add = [&](const Names& sources, const Names& silent, const char* name) {
    runs.push_back({{"sources", sources}});
    runs.back().update(replayed(replay, recording, silent, folder / name));
  };
  add({}, {}, "all");
  if (runs.back().contains("failed"))
    return runs;
  const Names heard = heard_in(runs.back());
  runs.back()["sources"] = heard;
  const std::set<std::string> imus = imus_of(recording.where);
  Names inertial = heard, others = heard;
  std::erase_if(inertial, [&](const std::string& name) { return !imus.contains(name); });
  std::erase_if(others, [&](const std::string& name) { return imus.contains(name); });
  if (!inertial.empty() && !others.empty())
    add(inertial, others, "imu");
  if (!heard.empty())
    add({}, heard, "alone");
  return runs;
}

Task task_of_recording(const Arguments& arguments, const FoundRecording& recording, const Programs& programs,
                       Results& entry) {
  entry = {{"recording", recording.name}};
  return {"looked at " + recording.name, 1, false, [=, &arguments, &entry] {
            entry["receiver"] = receiver_speed(recording.where);
            entry["runs"] = runs_on(programs.replay, recording, arguments.output / "runs" / recording.name);
          }};
}

Task task_of_drive(const Arguments& arguments, const Course& drive, const Programs& programs, Results& entry) {
  entry = {{"recording", drive.name}, {"simulation", drive.simulation}};
  return {"simulated and replayed " + drive.name, arguments.duration_s / kSimulationSpeed, false,
          [=, &arguments, &entry] {
            std::vector<std::string> command{programs.sim};
            command.insert(command.end(), drive.simulation.begin(), drive.simulation.end());
            command.insert(command.end(), {"-o", drive.folder.string()});
            std::error_code ignored;
            std::filesystem::create_directories(drive.folder.parent_path(), ignored);
            if (const auto problem = run_program(command, drive.folder.string() + ".log"))
              entry["runs"] = {{{"sources", Results::array()}, {"failed", *problem}}};
            else
              entry["runs"] = runs_on(programs.replay, {drive.name, drive.folder},
                                      arguments.output / "runs" / "simulated" / drive.name);
            if (!arguments.keep_captures)
              std::filesystem::remove_all(drive.folder, ignored);
          }};
}

} // namespace

std::vector<Course> drives_of_accuracy(const Arguments& arguments) {
  if (!arguments.simulated)
    return {};
  const auto drive = [&](const std::string& name, const char* world, const char* robot) {
    return Course{
        name,
        arguments.output / "courses" / name,
        {"--world", world, "--robot", robot, "--seed", "1", "--duration", std::to_string(arguments.duration_s)}};
  };
  std::vector<Course> drives{drive("husky-plant", "urban", "husky"), drive("husky-mine", "tunnel", "husky"),
                             drive("spot-plant", "urban", "spot")};
  for (Course& course : drives)
    std::ranges::copy(realism_of(arguments), std::back_inserter(course.simulation));
  return drives;
}

Results accuracy_of(const Arguments& arguments, const std::vector<FoundRecording>& recordings,
                    const std::vector<Course>& drives, const Programs& programs) {
  std::vector<Results> entries(recordings.size() + drives.size());
  std::vector<Task> tasks;
  tasks.reserve(entries.size());
  auto entry = entries.begin();
  for (const FoundRecording& recording : recordings)
    tasks.push_back(task_of_recording(arguments, recording, programs, *entry++));
  for (const Course& drive : drives)
    tasks.push_back(task_of_drive(arguments, drive, programs, *entry++));
  conduct(tasks, arguments.jobs, arguments.quiet);
  Results results{{"version", LOCUS_VERSION},   {"machine", machine_name()},          {"jobs", arguments.jobs},
                  {"simulated", drives.size()}, {"duration_s", arguments.duration_s}, {"places", Results::array()},
                  {"recordings", entries}};
  for (const path& place : arguments.recordings)
    results["places"].push_back(std::filesystem::absolute(place / "").parent_path().filename().string());
  return results;
}

} // namespace locus::experiments
