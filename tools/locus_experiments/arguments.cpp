// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/arguments.hpp"

#include <algorithm>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command_line.hpp"
#include "locus_experiments/harsh_plan.hpp"
#include "locus_replay/failure.hpp"
#include "locus_sim/imperfections.hpp"

namespace locus::experiments {

using tools::ExitStatus;
using tools::Failure;

std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  arguments.jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));

  CLI::App app{"Runs the evaluation of the LOCUS paper on simulated courses or on your recordings and writes one page "
               "of figures.",
               "locus-experiments"};
  auto* recordings =
      app.add_option("RECORDING", arguments.recordings,
                     "Capture folders to replay; without any, the courses of the paper are simulated. With "
                     "--accuracy or --subsets: files and folders to search");
  app.add_option(
         "-o,--output", arguments.output,
         "Folder for experiments.html, results.json and the runs; created if missing. Finished runs in it are not "
         "repeated")
      ->required()
      ->type_name("DIR");
  auto* duration =
      app.add_option(
             "--duration", arguments.duration_s,
             fmt::format("Duration of each simulated course, seconds; {} by default with --harsh or --subsets; the "
                         "paper's last 3600",
                         kHarshCourse_s))
          ->type_name("S")
          ->capture_default_str()
          ->check(CLI::Range(10, 36'000));
  auto* realism =
      app.add_option("--realism", arguments.realism, "Realism of the simulated courses, as in locus-sim")
          ->capture_default_str()
          ->check(CLI::IsMember(std::vector<std::string>(sim::kRealismNames.begin(), sim::kRealismNames.end())));
  app.add_option("--pace", arguments.pace_s, "Duration of each run at the pace of the recording, seconds")
      ->type_name("S")
      ->capture_default_str()
      ->check(CLI::Range(10, 36'000));
  auto* faults =
      app.add_flag("--faults", arguments.faults, "Instead: the effect of each fault of each sensor: faults.md")
          ->excludes(recordings);
  auto* matrix = app.add_flag("--fault-matrix", arguments.fault_matrix,
                              "Instead: every fault of every input, from the start and mid-drive: matrix.md")
                     ->excludes(recordings)
                     ->excludes(faults);
  auto* harsh = app.add_flag("--harsh", arguments.harsh,
                             "Instead: every course in a real and in a harsh world, and each group of imperfections "
                             "alone, from ten starts, with all sensors, lidar and IMU, lidar alone: harsh.md")
                    ->excludes(recordings)
                    ->excludes(faults)
                    ->excludes(matrix)
                    ->excludes(realism);
  auto* subsets = app.add_flag("--subsets", arguments.subsets,
                               "Instead: accuracy of all sources compared with the best subset of them, with views of "
                               "360, 180 and 90 degrees, on the recordings with truth in these folders or on the "
                               "courses of --harsh: subsets.md")
                      ->excludes(faults)
                      ->excludes(matrix)
                      ->excludes(harsh)
                      ->excludes(realism);
  app.add_option(
         "--starts", arguments.starts,
         "Number of drives of each course or recording with --subsets, from places in its first half to its end")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 100))
      ->needs(subsets);
  auto* only =
      app.add_option(
             "--only", arguments.only,
             "Only the rows of --harsh or --subsets whose COURSE/IMPERFECTION contains TEXT, as in corridor/people")
          ->type_name("TEXT")
          ->excludes(recordings);
  auto* accuracy = app.add_flag("--accuracy", arguments.accuracy,
                                "Instead: accuracy on all recordings in these folders, at any depth: accuracy.md")
                       ->excludes(faults)
                       ->excludes(matrix)
                       ->excludes(harsh)
                       ->excludes(subsets);
  app.add_flag("--simulated", arguments.simulated, "Also simulates three drives for --accuracy")->needs(accuracy);
  app.add_option("--seeds", arguments.seeds, "Number of seeds of each course with --faults, --harsh or --subsets")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 100))
      ->excludes(recordings);
  app.add_option("--consistency", arguments.honesty_runs,
                 "Number of runs of 60 s that check the covariances of --faults; 0: none")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(0, 10'000))
      ->needs(faults);
  app.add_option("--jobs", arguments.jobs, "Number of parallel runs; runs that measure speed run alone")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  app.add_option(
         "--launcher", arguments.launcher,
         "Shell words that precede each simulation and run, for example srun with its options; $cpus is the number "
         "of processors of the run")
      ->type_name("COMMAND");
  app.add_option("--compare", arguments.compare,
                 "Results of an earlier run: marks each row as better, worse or the same: compare.md")
      ->type_name("BEFORE.json")
      ->excludes(accuracy);
  app.add_flag("--keep-captures", arguments.keep_captures, "Keeps the simulated courses in DIR/courses");
  app.add_flag("--quiet", arguments.quiet, "Prints only errors");
  app.set_version_flag("--version", "locus-experiments " LOCUS_VERSION);
  app.footer("Examples:\n"
             "  locus-experiments -o experiments\n"
             "  locus-experiments -o fleet robot1/ robot2/ robot3/\n"
             "  locus-experiments --faults --duration 120 -o faults\n"
             "  locus-experiments --fault-matrix --duration 120 -o matrix\n"
             "  locus-experiments --harsh --seeds 1 -o harsh\n"
             "  locus-experiments --harsh --only plant/real --duration 40 --seeds 1 -o small\n"
             "  locus-experiments --subsets --only plant/real --seeds 1 -o subsets\n"
             "  locus-experiments --subsets --starts 5 -o subsets recordings/\n"
             "  locus-experiments --faults --duration 120 --compare before/results.json -o faults\n"
             "  locus-experiments --accuracy -o accuracy recordings/");
  if (!tools::parse_command_line(app, argc, argv))
    return std::nullopt;
  if (!only->empty() && !arguments.harsh && !arguments.subsets)
    throw Failure(ExitStatus::wrong_usage, "--only: requires --harsh or --subsets");
  if ((arguments.harsh || arguments.subsets) && duration->empty())
    arguments.duration_s = kHarshCourse_s;
  if (arguments.accuracy && arguments.recordings.empty() && !arguments.simulated)
    throw Failure(ExitStatus::wrong_usage, "--accuracy: name folders with recordings, or use --simulated");
  return arguments;
}

} // namespace locus::experiments
