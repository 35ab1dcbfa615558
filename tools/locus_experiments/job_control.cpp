// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/job_control.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sched.h>
#include <sys/wait.h>

#include "locus_experiments/measurement.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/output_file.hpp"

template <class T> struct nlohmann::adl_serializer<std::optional<T>> {
  static void to_json(nlohmann::json& json, const std::optional<T>& value) {
    json = value ? nlohmann::json(*value) : nlohmann::json(nullptr);
  }
  static void from_json(const nlohmann::json& json, std::optional<T>& value) {
    value = json.is_null() ? std::nullopt : std::optional(json.get<T>());
  }
};

namespace locus::experiments {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Interval, from_s, until_s)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Run, course, configuration, options, paced_cpus, loam_features, watched,
                                   mounting_rad, refusal, shows_recording, shows_subset)

namespace {

using nlohmann::json;
using std::filesystem::path;
using tools::ExitStatus;
using tools::Failure;
using Words = std::vector<std::string>;

constexpr const char* kRules = R"(
pool alone
  depth = 1
rule simulate
  command = rm -rf $course; LAUNCHER $program -o $course > $log 2>&1; echo $$? > $out$after
  rspfile = $out.runs
  rspfile_content = $runs
  description = simulate $name
rule run
  command = LAUNCHER $program > $folder/log 2>&1; $row $$? $folder $course $run
  description = run $name
rule leave
  command = rm -rf $course && touch $out
  description = leave $name
)";

/// Returns the path of a program of the same build or package.
std::string sibling(const char* name) {
  const path program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
  if (!std::filesystem::exists(program))
    throw Failure(ExitStatus::failed, fmt::format("{}: not found; install all of locus-tools", program.string()));
  return program.string();
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
    text.replace(at, what.size(), by);
  return text;
}

std::string shell_word(const std::string& text) {
  const auto is_plain = [](char c) {
    return std::string_view{"/._-+=:,@"}.find(c) != std::string_view::npos ||
           std::isalnum(static_cast<unsigned char>(c)) != 0;
  };
  return !text.empty() && std::ranges::all_of(text, is_plain) ? text : "'" + replaced(text, "'", "'\\''") + "'";
}

std::string shell_words(const Words& words) {
  Words quoted;
  std::ranges::transform(words, std::back_inserter(quoted), shell_word);
  return fmt::format("{}", fmt::join(quoted, " "));
}

/// Escapes the value of a Ninja variable.
std::string ninja_value(const std::string& text) { return replaced(text, "$", "$$"); }

/// Escapes an input or output of a Ninja build statement.
std::string ninja_path(const path& file) {
  return replaced(replaced(ninja_value(file.string()), " ", "$ "), ":", "$:");
}

std::string text_of(const json& plan) { return plan.dump(-1, ' ', false, json::error_handler_t::replace); }

/// Paths of the files of a course and its runs.
struct Places {
  path output;

  [[nodiscard]] path runs(const std::string& course) const { return output / "runs" / course; }
  [[nodiscard]] path folder(const Run& run) const { return runs(run.course) / run.configuration; }
  [[nodiscard]] path row(const Run& run) const { return folder(run) / "row.json"; }
  [[nodiscard]] path simulated(const std::string& course) const { return runs(course) / "simulated"; }
  [[nodiscard]] path log(const std::string& course) const { return runs(course) / "log"; }
  [[nodiscard]] path left(const std::string& course) const { return runs(course) / "left"; }
};

/// Writes the plan as a Ninja file.
class NinjaFile {
 public:
  NinjaFile(const Plan& plan, const Arguments& arguments, const Places& places)
      : plan_(plan), arguments_(arguments), places_(places), file_(places.output / "build.ninja") {}

  void write() {
    file_.print("# Jobs of locus-experiments in this folder.\nbuilddir = {}\nrow = {}\ncpus = 1\n{}",
                ninja_value(places_.output.string()), ninja_value(shell_words({self_, std::string(kRowCommand)})),
                replaced(kRules, "LAUNCHER", arguments_.launcher));
    for (const Course& course : plan_.courses) {
      if (!course.simulation.empty())
        simulate(course);
      for (const Run& run : runs_on(course))
        drive(run, course);
      if (!course.simulation.empty() && !arguments_.keep_captures)
        leave(course);
    }
    file_.print("build untimed: phony{}\n", untimed_);
    file_.close();
  }

  /// Returns whether there are enough processors for the run.
  static bool is_possible(const Run& run) { return static_cast<std::size_t>(run.paced_cpus) <= usable_cpus().size(); }

 private:
  [[nodiscard]] std::vector<Run> runs_on(const Course& course) const {
    std::vector<Run> runs;
    std::ranges::copy_if(plan_.runs, std::back_inserter(runs),
                         [&](const Run& run) { return run.course == course.name && is_possible(run); });
    return runs;
  }

  void set(const char* variable, const std::string& value) { file_.print("  {} = {}\n", variable, ninja_value(value)); }

  /// Simulates a course only when a run needs it: captures may be gigabytes, so few are on disk at a time. The capture
  /// is deleted afterwards, so any further run on the course needs it, and repeats all its runs.
  void simulate(const Course& course) {
    std::string earlier;
    if (const auto most = static_cast<std::size_t>(arguments_.jobs) + 1; left_.size() >= most)
      earlier = " ||" + left_[left_.size() - most];
    file_.print("build {}: simulate | {} {} {}{}\n", ninja_path(places_.simulated(course.name)), ninja_path(simulator_),
                ninja_path(replay_), ninja_path(self_), earlier);
    Words program{simulator_};
    program.insert(program.end(), course.simulation.begin(), course.simulation.end());
    const path folder = std::filesystem::absolute(course.folder);
    set("name", course.name);
    set("course", shell_word(folder));
    set("log", shell_word(places_.log(course.name)));
    set("program", shell_words(program));
    std::vector<Run> runs = runs_on(course);
    std::erase_if(runs, [](const Run& run) { return run.shows_recording; }); // these depend on the course
    set("runs", text_of(runs));
    if (!course.has_true_map)
      set("after", "; rm -f " + shell_word(folder / "gt_map.ply"));
  }

  void drive(const Run& run, const Course& course) {
    const bool paced = run.paced_cpus > 0;
    const std::string row = ninja_path(places_.row(run));
    if (!paced)
      untimed_ += ' ' + row;
    file_.print("build {}: run{} | {} {}{}\n", row,
                course.simulation.empty() ? "" : ' ' + ninja_path(places_.simulated(course.name)), ninja_path(replay_),
                ninja_path(self_), paced ? " || untimed\n  pool = alone" : "");
    if (paced)
      set("cpus", std::to_string(run.paced_cpus));
    set("name", run.id());
    set("course", shell_word(std::filesystem::absolute(course.folder)));
    set("folder", shell_word(places_.folder(run)));
    set("program", shell_words(replay(run, course)));
    set("run", shell_word(text_of(run)));
  }

  [[nodiscard]] Words replay(const Run& run, const Course& course) const {
    Words words;
    if (run.paced_cpus > 0 && arguments_.launcher.empty()) { // with a launcher, that assigns the processors
      std::vector<int> cpus = usable_cpus();
      cpus.resize(static_cast<std::size_t>(run.paced_cpus));
      words = {"taskset", "--cpu-list", fmt::format("{}", fmt::join(cpus, ","))};
    }
    if (run.loam_features)
      words.insert(words.end(), {self_, std::string(kLoamReplay)});
    else
      words.push_back(replay_);
    words.insert(words.end(), {"--quiet", "-o", places_.folder(run)});
    if (run.paced_cpus == 0)
      words.insert(words.end(), {"--threads", "1"}); // same result; other runs use the other cores
    words.insert(words.end(), run.options.begin(), run.options.end());
    words.push_back(std::filesystem::absolute(course.folder));
    return words;
  }

  void leave(const Course& course) {
    const std::string left = ninja_path(places_.left(course.name));
    std::string rows;
    bool is_timed = false;
    for (const Run& run : runs_on(course)) {
      rows += ' ' + ninja_path(places_.row(run));
      is_timed |= run.paced_cpus > 0;
    }
    file_.print("build {}: leave{}{}\n", left, rows, is_timed ? "\n  pool = alone" : "");
    set("name", course.name);
    set("course", shell_word(std::filesystem::absolute(course.folder)));
    if (!is_timed) // timed runs wait for all other courses, so none of these may wait for them
      left_.push_back(' ' + left);
  }

  const Plan& plan_;
  const Arguments& arguments_;
  const Places& places_;
  tools::OutputFile file_;
  std::string simulator_ = sibling("locus-sim"), replay_ = sibling("locus-replay"),
              self_ = sibling("locus-experiments");
  std::string untimed_;
  Words left_; ///< courses without timed runs written so far
};

/// Runs Ninja, once at a time per output folder: waits for leftovers of a killed call; ends with this process.
void run_ninja(const Places& places, const Arguments& arguments) {
  const std::string command = fmt::format("exec setpriv --pdeathsig TERM flock --no-fork {} ninja -f {} -k 0 -j {}{}",
                                          shell_word(places.output), shell_word(places.output / "build.ninja"),
                                          arguments.jobs, arguments.quiet ? " > /dev/null" : "");
  const int status = std::system(command.c_str());
  if (status != 0)
    throw Failure(ExitStatus::failed, fmt::format("ninja ended with status {}; start locus-experiments again to resume",
                                                  WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status)));
}

std::string last_line_of(const path& file) {
  std::ifstream stream{file};
  std::string last;
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty())
      last = line;
  }
  return last;
}

/// Returns why a program failed, by its shell exit status and last message; nothing if it succeeded.
std::optional<std::string> problem_of(int status, const path& log) {
  if (status == 0)
    return std::nullopt;
  const std::string message = last_line_of(log);
  if (status > 128)
    return fmt::format("ended by signal {}", status - 128);
  return message.empty() ? "failed without an error message" : message;
}

std::optional<std::string> problem_of(const Course& course, const Places& places) {
  if (course.simulation.empty())
    return std::nullopt;
  int status = 1;
  std::ifstream{places.simulated(course.name)} >> status;
  return problem_of(status, places.log(course.name));
}

/// Deletes maps and reports: a thousand drives would leave a gigabyte of them.
void keep_figures_alone(const path& run_folder) {
  for (const char* const name : {"map.pcd", "odometry.csv", "odometry.tum", "report.html"})
    std::filesystem::remove(run_folder / name);
}

Results row_of(int status, const path& folder, const path& capture, const Run& run) {
  Results row{{"course", run.course}, {"configuration", run.configuration}};
  try {
    if (const auto problem = problem_of(status, folder / "log")) {
      const bool refused = !run.refusal.empty() && problem->find(run.refusal) != std::string::npos;
      row[refused ? "refused" : "failed"] = *problem;
      return row;
    }
    row.update(measurement(run, folder, capture));
    if (run.mounting_rad)
      keep_figures_alone(folder);
  } catch (const std::exception& error) {
    row["failed"] = error.what();
  }
  return row;
}

} // namespace

std::vector<int> usable_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof(set), &set);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set))
      cpus.push_back(cpu);
  }
  return cpus;
}

void write_row(std::span<char* const> arguments) {
  if (arguments.size() != 4)
    throw Failure(ExitStatus::wrong_usage, "row: for internal use by locus-experiments only");
  const path folder = arguments[1];
  const Results row = row_of(std::atoi(arguments[0]), folder, arguments[2], json::parse(arguments[3]).get<Run>());
  tools::OutputFile file(folder / "row.json");
  file.print("{}\n", row.dump(1, ' ', false, Results::error_handler_t::replace));
  file.close();
}

Results carry_out(const Plan& plan, const Arguments& arguments) {
  const Places places{std::filesystem::absolute(arguments.output)};
  NinjaFile(plan, arguments, places).write();
  run_ninja(places, arguments);
  std::error_code ignored;
  std::filesystem::remove(places.output / "courses", ignored); // if it is empty
  std::map<std::string, std::optional<std::string>> broken;
  for (const Course& course : plan.courses)
    broken[course.name] = problem_of(course, places);
  Results rows = Results::array();
  for (const Run& run : plan.runs) {
    std::optional<std::string> problem = broken.at(run.course);
    if (!problem && !NinjaFile::is_possible(run))
      problem = fmt::format("needs {} processors, and this machine has {}", run.paced_cpus, usable_cpus().size());
    rows.push_back(problem ? Results{{"course", run.course}, {"configuration", run.configuration}, {"failed", *problem}}
                           : read_json(places.row(run)));
  }
  return rows;
}

} // namespace locus::experiments
