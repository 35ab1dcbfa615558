// SPDX-License-Identifier: Apache-2.0
// locus-experiments: the evaluation of the LOCUS paper in one page.
#include <algorithm>
#include <csignal>
#include <exception>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "locus_experiments/accuracy_page.hpp"
#include "locus_experiments/arguments.hpp"
#include "locus_experiments/child_process.hpp"
#include "locus_experiments/compare.hpp"
#include "locus_experiments/conductor.hpp"
#include "locus_experiments/loam_features.hpp"
#include "locus_experiments/measurement.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/recordings.hpp"
#include "locus_experiments/results.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/replay_program.hpp"
#include "locus_replay/say.hpp"

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;

/// How much faster than the recording things go, roughly: for the progress bar.
constexpr double kSimulationSpeed = 5, kReplaySpeed = 30;

constexpr const char* kCourses = "courses";

/// First argument of the children that run locus-replay with LOAM's points in place of the filters.
constexpr std::string_view kLoamReplay = "replay-with-loam-features";

/// A program of the same build or package as this one.
std::string sibling(const char* name) {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
  if (!std::filesystem::exists(program))
    throw Failure(ExitStatus::failed, fmt::format("{}: is not there; install locus-tools whole", program.string()));
  return program.string();
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw Failure(ExitStatus::failed, fmt::format("{}: the folder cannot be made ({}); choose another with -o",
                                                  folder.string(), error.message()));
}

/// What was simulated; a recording stays.
void take_away(const Course& course) {
  std::error_code ignored;
  if (!course.simulation.empty())
    std::filesystem::remove_all(course.folder, ignored);
}

/// A thousand drives would leave a gigabyte of maps and reports.
void keep_figures_alone(const std::filesystem::path& run_folder) {
  std::error_code ignored;
  for (const char* const name : {"map.pcd", "odometry.csv", "odometry.tum", "report.html"})
    std::filesystem::remove(run_folder / name, ignored);
}

/// What results say before any run is done.
Results what_is_asked(const Arguments& arguments) {
  Results asked{{"version", LOCUS_VERSION},
                {"simulated", arguments.recordings.empty()},
                {"duration_s", arguments.recordings.empty() ? Results(arguments.duration_s) : Results(nullptr)}};
  if (arguments.faults)
    asked["faults"] = {{"seeds", arguments.seeds}, {"consistency_runs", arguments.honesty_runs}};
  if (arguments.fault_matrix)
    asked["matrix"] = Results::object();
  if (arguments.harsh)
    asked["harsh"] = {{"seeds", arguments.seeds}, {"only", arguments.only}};
  else if (arguments.recordings.empty())
    asked["realism"] = arguments.realism;
  return asked;
}

/// The plan carried out, and what came of it.
class Experiments {
 public:
  Experiments(const Arguments& arguments, Plan plan)
      : arguments_(arguments), plan_(std::move(plan)), replay_(sibling("locus-replay")) {}

  Results carry_out() {
    conduct(tasks(), arguments_.jobs, arguments_.quiet);
    return results();
  }

 private:
  [[nodiscard]] std::vector<Task> tasks();
  [[nodiscard]] Task simulation_of(const Course& course);
  [[nodiscard]] std::vector<Task> runs_on(const Course& course);
  void carry_out(const Run& run);
  void leave(const Course& course);
  [[nodiscard]] std::optional<std::string> why_impossible(const Run& run);
  [[nodiscard]] const Course& course_of(const Run& run) const {
    return *std::ranges::find(plan_.courses, run.course, &Course::name);
  }
  [[nodiscard]] Results results() const;

  const Arguments& arguments_;
  Plan plan_;
  std::string replay_;
  std::mutex mutex_;
  std::map<std::string, std::string> broken_courses_; ///< by name, why
  std::map<std::string, Results> done_;               ///< by Run::id()
  std::map<std::string, int> runs_left_;              ///< on a course, by its name
};

/// A course is simulated when there is somebody to drive on it, and is gone after the last: only a few of them lie on
/// the disk at a time.
std::vector<Task> Experiments::tasks() {
  make_folder(arguments_.output / kCourses);
  std::vector<Task> tasks;
  for (const Course& course : plan_.courses) {
    std::vector<Task> runs = runs_on(course);
    runs_left_[course.name] = static_cast<int>(runs.size());
    if (course.simulation.empty()) {
      std::ranges::move(runs, std::back_inserter(tasks));
    } else {
      tasks.push_back(simulation_of(course));
      tasks.back().then = std::move(runs);
    }
  }
  return tasks;
}

Task Experiments::simulation_of(const Course& course) {
  std::vector<std::string> command{sibling("locus-sim")};
  command.insert(command.end(), course.simulation.begin(), course.simulation.end());
  command.insert(command.end(), {"-o", course.folder.string()});
  return {"simulated " + course.name, arguments_.duration_s / kSimulationSpeed, false, [=, this] {
            if (const auto problem = run_program(command, course.folder.string() + ".log")) {
              const std::lock_guard lock(mutex_);
              broken_courses_[course.name] = *problem;
            }
            if (!course.has_true_map) {
              std::error_code ignored;
              std::filesystem::remove(course.folder / "gt_map.ply", ignored);
            }
          }};
}

std::vector<Task> Experiments::runs_on(const Course& course) {
  std::vector<Task> tasks;
  for (const Run& run : plan_.runs) {
    const bool paced = run.paced_cpus > 0;
    if (run.course == course.name)
      tasks.push_back({"ran " + run.id(), paced ? arguments_.pace_s : arguments_.duration_s / kReplaySpeed, paced,
                       [&run, this] { carry_out(run); }});
  }
  return tasks;
}

/// A run on it is over. The last one takes along what was simulated.
void Experiments::leave(const Course& course) {
  const bool over = --runs_left_[course.name] == 0;
  if (over && !arguments_.keep_captures)
    take_away(course);
}

std::optional<std::string> Experiments::why_impossible(const Run& run) {
  const std::lock_guard lock(mutex_);
  if (const auto broken = broken_courses_.find(run.course); broken != broken_courses_.end())
    return broken->second;
  if (const auto cpus = usable_cpus().size(); static_cast<std::size_t>(run.paced_cpus) > cpus)
    return fmt::format("needs {} processors, there is {}", run.paced_cpus, cpus);
  return std::nullopt;
}

void Experiments::carry_out(const Run& run) {
  const Course& course = course_of(run);
  const std::filesystem::path folder = arguments_.output / "runs" / run.course / run.configuration;
  Results result;
  try {
    make_folder(folder);
    std::vector<std::string> command{replay_};
    if (run.loam_features)
      command = {sibling("locus-experiments"), std::string{kLoamReplay}};
    command.insert(command.end(), {"--quiet", "-o", folder.string()});
    if (run.paced_cpus == 0)
      command.insert(command.end(), {"--threads", "1"}); // the result is the same, and other runs have the other cores
    command.insert(command.end(), run.options.begin(), run.options.end());
    command.push_back(course.folder.string());
    std::vector<int> cpus;
    if (run.paced_cpus > 0) {
      cpus = usable_cpus();
      cpus.resize(std::min(cpus.size(), static_cast<std::size_t>(run.paced_cpus)));
    }
    std::optional<std::string> problem = why_impossible(run);
    if (!problem)
      problem = run_program(command, folder / "log", cpus);
    const bool refused = problem && !run.refusal.empty() && problem->find(run.refusal) != std::string::npos;
    result = problem ? Results{{"course", run.course},
                               {"configuration", run.configuration},
                               {refused ? "refused" : "failed", *problem}}
                     : measurement(run, folder, course);
    if (run.mounting_rad && !problem)
      keep_figures_alone(folder);
  } catch (const std::exception& error) {
    result = {{"course", run.course}, {"configuration", run.configuration}, {"failed", error.what()}};
  }
  const std::lock_guard lock(mutex_);
  done_[run.id()] = std::move(result);
  leave(course);
}

Results Experiments::results() const {
  Results results = what_is_asked(arguments_);
  results["planned"] = plan_.size;
  results["runs"] = Results::array();
  for (const Run& run : plan_.runs) {
    results["runs"].push_back(done_.at(run.id()));
    results["runs"].back()["place"] = run.place;
  }
  judge(results);
  return results;
}

/// Each failed run in a line of its own; nothing if all is well.
std::string failures_in(const Results& results) {
  std::string lines;
  for (const Results& run : results.value("runs", Results::array())) {
    if (run.contains("failed"))
      lines += fmt::format("{}{}/{}: {}", lines.empty() ? "" : "\n", run.at("course").get<std::string>(),
                           run.at("configuration").get<std::string>(), run.at("failed").get<std::string>());
  }
  const Results recordings = results.value("recordings", Results::array()); // those of --accuracy
  const auto failed = [](const Results& recording) { return recording.at("runs").front().contains("failed"); };
  if (!recordings.empty() && std::ranges::all_of(recordings, failed))
    lines = "no recording could be replayed; accuracy.md says of each why not";
  return lines;
}

/// All that may be left of them, and the folder if nobody else has put anything there.
void take_away(const std::vector<Course>& courses, const std::filesystem::path& folder) {
  std::error_code ignored;
  for (const Course& course : courses) {
    take_away(course);
    if (!course.simulation.empty())
      std::filesystem::remove(course.folder.string() + ".log", ignored);
  }
  std::filesystem::remove(folder, ignored);
}

/// When somebody ends this program: ends the programs that it runs, takes the courses away, which may be gigabytes, and
/// ends as others do. To be called before there are threads.
void leave_nothing_when_interrupted(const std::vector<Course>& courses, const std::filesystem::path& folder) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([=] {
    int signal = 0;
    sigwait(&signals, &signal);
    const auto none_goes_on = end_programs();
    take_away(courses, folder);
    pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
    raise(signal);
  }).detach();
}

Results experiment(const Arguments& arguments) {
  const Plan plan = make_plan(arguments);
  const std::filesystem::path courses = arguments.output / kCourses;
  if (!arguments.keep_captures)
    leave_nothing_when_interrupted(plan.courses, courses);
  Results results = Experiments(arguments, plan).carry_out();
  if (!arguments.keep_captures)
    take_away(plan.courses, courses);
  return results;
}

Results accuracy(const Arguments& arguments) {
  const std::vector<FoundRecording> recordings = find_recordings(arguments.recordings, arguments.output);
  const std::vector<Course> drives = drives_of_accuracy(arguments);
  if (recordings.empty() && drives.empty()) {
    const std::vector<std::string> places(arguments.recordings.begin(), arguments.recordings.end());
    throw Failure(ExitStatus::failed, fmt::format("{}: no recording, at any depth; looked for {}",
                                                  fmt::join(places, ", "), kKindsOfRecordings));
  }
  const std::filesystem::path courses = arguments.output / kCourses;
  if (!arguments.keep_captures)
    leave_nothing_when_interrupted(drives, courses);
  Results results = accuracy_of(arguments, recordings, drives, {sibling("locus-replay"), sibling("locus-sim")});
  if (!arguments.keep_captures)
    take_away(drives, courses);
  return results;
}

void run(const Arguments& arguments) {
  std::optional<ResultsBefore> before;
  if (!arguments.compare.empty())
    before.emplace(arguments.compare);
  if (before && arguments.merge.empty()) // an hour before it would be of use
    before->check_is_of(what_is_asked(arguments));
  make_folder(arguments.output);
  const Results results = arguments.accuracy        ? accuracy(arguments)
                          : arguments.merge.empty() ? experiment(arguments)
                                                    : merged(arguments.merge);
  const std::filesystem::path page = write_results(arguments.output, results);
  if (!arguments.quiet)
    fmt::print("results in {}\n", page.string());
  if (before) {
    const std::string comparison = write_comparison(*before, results, arguments.output);
    if (!arguments.quiet)
      fmt::print("{}", comparison);
  }
  if (const std::string failures = failures_in(results); !failures.empty())
    throw Failure(ExitStatus::failed, failures);
}

} // namespace
} // namespace locus::experiments

int main(int argc, char** argv) {
  using namespace locus::experiments;
  const auto say = [](const char* what) { locus::tools::say("locus-experiments", what); };
  if (argc > 1 && argv[1] == kLoamReplay)
    return locus::tools::replay_program(argc - 1, argv + 1, keep_loam_features);
  try {
    if (const std::optional<Arguments> arguments = parse_arguments(argc, argv))
      run(*arguments);
    locus::tools::flush_standard_output();
    return static_cast<int>(ExitStatus::done);
  } catch (const Failure& failure) {
    say(failure.what());
    return static_cast<int>(failure.status());
  } catch (const std::exception& error) {
    say(error.what());
    return static_cast<int>(ExitStatus::failed);
  }
}
