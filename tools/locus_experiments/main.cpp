// SPDX-License-Identifier: Apache-2.0
// locus-experiments: the evaluation of the LOCUS paper in one page.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include <fmt/format.h>

#include "command_line.hpp"
#include "locus_experiments/accuracy_page.hpp"
#include "locus_experiments/arguments.hpp"
#include "locus_experiments/compare.hpp"
#include "locus_experiments/job_control.hpp"
#include "locus_experiments/loam_features.hpp"
#include "locus_experiments/plan.hpp"
#include "locus_experiments/results.hpp"
#include "locus_experiments/subset_experiment.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_replay/replay_program.hpp"

namespace locus::experiments {
namespace {

using tools::ExitStatus;
using tools::Failure;

Results subsets_asked(const Arguments& arguments) {
  Results subsets{{"starts", arguments.starts}};
  if (arguments.recordings.empty())
    subsets.update({{"seeds", arguments.seeds}, {"only", arguments.only}});
  for (const std::filesystem::path& place : arguments.recordings)
    subsets["places"].push_back(std::filesystem::absolute(place / "").parent_path().filename().string());
  return subsets;
}

/// Returns the results before any run: the request.
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
  else if (arguments.subsets)
    asked["subsets"] = subsets_asked(arguments);
  else if (arguments.recordings.empty())
    asked["realism"] = arguments.realism;
  return asked;
}

/// Lists each failed run in a line of its own; empty without any.
std::string failures_in(const Results& results) {
  std::string lines;
  for (const Results& run : results.value("runs", Results::array())) {
    if (run.contains("failed"))
      lines += fmt::format("{}{}/{}: {}", lines.empty() ? "" : "\n", run.at("course").get<std::string>(),
                           run.at("configuration").get<std::string>(), run.at("failed").get<std::string>());
  }
  const Results recordings = results.value("recordings", Results::array()); // runs of --accuracy
  const auto failed = [](const Results& recording) { return recording.at("runs").front().contains("failed"); };
  if (!recordings.empty() && std::ranges::all_of(recordings, failed))
    lines = "no recording could be replayed; accuracy.md lists the reasons";
  return lines;
}

Results experiment(const Arguments& arguments) {
  if (arguments.accuracy)
    return accuracy_of(arguments);
  if (arguments.subsets)
    return results_of_subsets(arguments, what_is_asked(arguments));
  const Plan plan = make_plan(arguments);
  Results results = what_is_asked(arguments);
  results["runs"] = carry_out(plan, arguments);
  judge(results);
  return results;
}

void run(const Arguments& arguments) {
  std::optional<ResultsBefore> before;
  if (!arguments.compare.empty())
    before.emplace(arguments.compare);
  if (before) // reports a mismatch before the hours of runs
    before->check_is_of(what_is_asked(arguments));
  tools::make_folder(arguments.output);
  const Results results = experiment(arguments);
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
  if (argc > 1 && argv[1] == kLoamReplay)
    return locus::tools::replay_program(argc - 1, argv + 1, keep_loam_features);
  return locus::tools::exit_status_of("locus-experiments", [&] {
    if (argc > 1 && argv[1] == kRowCommand)
      write_row(std::span(argv, static_cast<std::size_t>(argc)).subspan(2));
    else if (const std::optional<Arguments> arguments = parse_arguments(argc, argv))
      run(*arguments);
  });
}
