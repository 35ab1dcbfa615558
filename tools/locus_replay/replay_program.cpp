// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/replay_program.hpp"

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include <fmt/format.h>
#include <sys/resource.h>

#include "command_line.hpp"
#include "daemon/inline_pipeline.hpp"
#include "daemon/input.hpp"
#include "daemon/live_pipeline.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/calibrate.hpp"
#include "locus_replay/discover.hpp"
#include "locus_replay/find_recording.hpp"
#include "locus_replay/mcap_results.hpp"
#include "locus_replay/open_recording.hpp"
#include "locus_replay/overwriting.hpp"
#include "locus_replay/print_message.hpp"
#include "locus_replay/recording.hpp"
#include "locus_replay/results.hpp"
#include "locus_replay/sweep_files.hpp"
#include "locus_replay/truth.hpp"

namespace locus::tools {
namespace {

using daemon::MachineTime;

/// Optional results requested by the user.
struct MoreResults {
  std::optional<McapResults> mcap;
  std::optional<SweepFiles> sweeps;

  MoreResults(const Arguments& arguments, const Config& config) {
    if (!arguments.mcap.empty())
      mcap.emplace(arguments.mcap, config);
    if (!arguments.sweeps.empty())
      sweeps.emplace(arguments.sweeps, arguments.sweeps_format);
  }
  void write(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done) {
    if (mcap)
      mcap->add(sweep, odometry, done);
    if (sweeps)
      sweeps->write(sweep, odometry, done.estimate);
  }
  void close() {
    if (mcap)
      mcap->close();
    if (sweeps)
      sweeps->close();
  }
};

/// Replays as fast as possible, with bit-identical results on every run.
void replay(const Config& config, LidarRouter lidars, Recording& recording, Results& results, MoreResults more,
            const SweepStage& stage, const EstimateObserver& observer) {
  std::optional<daemon::InlinePipeline> pipeline;
  const auto on_sweep = [&](const Sweep& sweep, const daemon::ProcessedSweep& done) {
    more.write(sweep, pipeline->processor().odometry(), done);
    if (observer)
      observer(done.estimate);
    if (more.mcap)
      more.mcap->add(pipeline->ingest(), pipeline->counters());
    results.add(done);
  };
  pipeline.emplace(
      config, std::move(lidars), on_sweep, [&](const HealthEvent& event) { results.add(event); }, stage);
  for (bool more_input = true; more_input;) {
    const daemon::Input input = recording.next(Duration::zero());
    pipeline->process(input);
    if (more.mcap)
      more.mcap->add(input, pipeline->ingest().lidars());
    more_input = !std::holds_alternative<daemon::EndOfInput>(input);
  }
  more.close();
  results.finish(pipeline->ingest(), pipeline->processor(), pipeline->counters());
}

/// Replays at the pace of the recording or a multiple of it, through the threads of the daemon.
void replay_live(const Config& config, LidarRouter lidars, Recording& recording, double speed, Results& results) {
  constexpr Duration kPatience = std::chrono::milliseconds{100};
  daemon::PacedInput paced(recording, speed);
  daemon::LivePipeline pipeline(config, std::move(lidars), paced, {.speed = speed});
  const auto add_events = [&] {
    while (const auto event = pipeline.next_health_event())
      results.add(*event);
  };
  while (!pipeline.finished()) {
    if (const auto done = pipeline.next(kPatience))
      results.add(*done);
    add_events();
  }
  pipeline.stop();
  add_events();
  results.finish(pipeline.ingest(), pipeline.processor(), pipeline.counters());
}

/// Raises the limit on open files: a bag may be a folder of more files than the default.
void allow_many_files() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
    return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

void run(Arguments arguments, const SweepStage& stage, const EstimateObserver& observer) {
  const MachineTime begin = MachineTime::now();
  if (!arguments.discover)
    check_output(arguments.output);
  ChosenRecording chosen = choose_recording(arguments);
  if (arguments.discover)
    return fmt::print("{}", proposal_for(arguments, chosen));
  const Config& config = chosen.config;
  check_nothing_is_written_over(arguments, chosen.files, config);
  if (!arguments.calibrate.empty()) {
    OutputFile file(arguments.calibrate); // opened before the minutes of computing
    CalibratedDrive drive = calibrate_by_drive(arguments, chosen);
    write_calibration(file, config, drive);
    chosen.config = std::move(drive.config);
  }
  OpenRecording open = open_recording(arguments, chosen);
  for (const std::string& warning : chosen.warnings)
    print_message("locus-replay", "warning: " + warning);
  for (const std::string& line : chosen.lines) {
    if (!arguments.quiet)
      fmt::print("{}\n", line);
  }

  Truth truth(arguments, chosen.files, std::move(open.truth));
  Results results(arguments, config, *open.recording, std::move(truth), begin);
  if (arguments.realtime_speed)
    replay_live(config, std::move(open.lidars), *open.recording, *arguments.realtime_speed, results);
  else
    replay(config, std::move(open.lidars), *open.recording, results, MoreResults(arguments, config), stage, observer);
}

} // namespace

int replay_program(int argc, char** argv, const SweepStage& stage, const EstimateObserver& observer) {
  return exit_status_of("locus-replay", [&] {
    allow_many_files();
    if (const std::optional<Arguments> arguments = parse_arguments(argc, argv))
      run(*arguments, stage, observer);
  });
}

} // namespace locus::tools
