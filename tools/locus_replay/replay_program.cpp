// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/replay_program.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "bags/bag.hpp"
#include "command_line.hpp"
#include "config/config_yaml.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/live_pipeline.hpp"
#include "daemon/sweep_processor.hpp"
#include "kitti/kitti_drive.hpp"
#include "locus_replay/arguments.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/recorded_input.hpp"
#include "locus_replay/recording.hpp"
#include "locus_replay/results.hpp"
#include "locus_replay/say.hpp"
#include "locus_replay/truth.hpp"

namespace locus::tools {
namespace {

using daemon::MachineTime;

Config config_or_fail(Expected<Config, ConfigErrors> config) {
  if (!config)
    throw Failure(ExitStatus::wrong_usage, fmt::format("{}", fmt::join(config.error(), "\n")));
  return *config;
}

Isa isa_or_fail(const std::string& name) {
  const std::optional<Isa> isa = from_string<Isa>(name);
  if (!isa || !is_supported(*isa))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("LOCUS_ISA={}: {}; unset it, or choose one of {} that this processor has", name,
                              isa ? "this processor cannot run it" : "no such instruction set",
                              fmt::join(names_of(Isa{}), ", ")));
  return *isa;
}

constexpr double kFastestCar_mps = 60.0;

/// Without a configuration the files of a folder tell which sources there were, those of a walking robot first, and
/// whether it was a car.
Config configuration_of(const CaptureFolder& folder, const std::filesystem::path& capture) {
  Config config;
  if (KittiDrive::is(capture))
    config.odometry.motion.max_speed_mps = kFastestCar_mps;
  for (const char* const name : {"kio", "vio"}) {
    if (std::ranges::find(folder.odometry, name, &CaptureFolder::Source::name) == folder.odometry.end())
      continue;
    config.motion_sources.insert(config.motion_sources.begin(), {{name, SourceKind::odometry, {}}, "", ""});
  }
  return config;
}

Config configuration(const std::filesystem::path& file, const CaptureFolder& folder, const Arguments& arguments) {
  Config config = file.empty() ? configuration_of(folder, arguments.capture) : config_or_fail(load_config(file));
  config = config_or_fail(override_config(config, arguments.overrides));
  if (const char* const isa = std::getenv("LOCUS_ISA"))
    config.use(isa_or_fail(isa));
  return config;
}

bool is_all_in_one(const std::filesystem::path& where) { return looks_like_bag(where) || KittiDrive::is(where); }

/// Results in the folder of a recording would be taken for its files by the next run.
void check_output(const std::filesystem::path& folder) {
  if (std::filesystem::is_directory(folder) && (CaptureFolder::find(folder) || is_all_in_one(folder)))
    throw Failure(ExitStatus::wrong_usage,
                  fmt::format("-o {}: holds a recording; choose another folder for the results", folder.string()));
}

void check_inputs_outlive_the_run(const Arguments& arguments) {
  std::vector<std::filesystem::path> inputs{arguments.capture, arguments.config, arguments.imu, arguments.ground_truth,
                                            arguments.map_truth};
  for (const Arguments::OdometryFile& odometry : arguments.odometry)
    inputs.push_back(odometry.file);
  for (const std::filesystem::path& input : inputs) {
    for (const char* const name : kResultFiles) {
      std::error_code ignored;
      if (std::filesystem::equivalent(arguments.output / name, input, ignored))
        throw Failure(ExitStatus::wrong_usage, fmt::format("{}: the run would write its own {} there; choose another "
                                                           "folder with -o",
                                                           input.string(), name));
    }
  }
}

/// What of a folder that is no recording itself, or of its folders, could be replayed.
std::vector<std::string> recordings_in(const std::filesystem::path& where) {
  constexpr int kDepth = 2; // KITTI: a day, and the drives of a day
  std::vector<std::string> found;
  std::error_code ignored;
  using std::filesystem::directory_options;
  std::filesystem::recursive_directory_iterator entry{where, directory_options::skip_permission_denied, ignored};
  for (const std::filesystem::recursive_directory_iterator end; !ignored && entry != end; entry.increment(ignored)) {
    const bool is_folder = entry->is_directory(ignored);
    const bool is_recording = is_folder && (is_all_in_one(entry->path()) || CaptureFolder::find(entry->path()));
    if (is_recording)
      found.push_back(entry->path().string());
    if (is_recording || entry.depth() + 1 >= kDepth)
      entry.disable_recursion_pending();
  }
  std::ranges::sort(found);
  return found;
}

/// A pipe cannot be read twice, and which format it has and when it begins is found out first.
void check_is_file_or_folder(const std::filesystem::path& capture) {
  std::error_code ignored;
  if (capture == "-" || std::filesystem::is_fifo(capture, ignored) ||
      std::filesystem::is_character_file(capture, ignored))
    throw Failure(
        ExitStatus::wrong_usage,
        fmt::format("{}: a recording is read from a file, not from a pipe; write it to one first, with: cat > "
                    "lidar.pcap, and name that",
                    capture.string()));
}

/// The files of a capture folder; a bag or a drive of KITTI has all in one.
CaptureFolder find_files(const std::filesystem::path& capture) {
  check_is_file_or_folder(capture);
  Expected<CaptureFolder, std::string> folder = CaptureFolder::find(capture);
  if (!folder && is_all_in_one(capture)) {
    CaptureFolder all;
    all.lidar = {capture};
    return all;
  }
  if (const auto inside = folder ? std::vector<std::string>{} : recordings_in(capture); !inside.empty()) {
    constexpr std::size_t kNamed = 3;
    const std::size_t named = std::min(kNamed, inside.size());
    throw Failure(ExitStatus::failed,
                  fmt::format("{}: holds recordings, but is none itself; name {}: {}{}", capture.string(),
                              inside.size() == 1 ? "the one in it" : "one of them",
                              fmt::join(inside.begin(), inside.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                              inside.size() > named ? fmt::format(" and {} more", inside.size() - named) : ""));
  }
  return value_or_fail(std::move(folder), ExitStatus::failed);
}

/// As fast as the machine can; the same bits on every run.
void replay(const Config& config, LidarRouter lidars, Recording& recording, Results& results, const SweepStage& stage,
            const EstimateObserver& observer) {
  daemon::SweepCounters counters;
  daemon::SweepProcessor processor(config);
  const auto process = [&](daemon::Ingest& ingest, Sweep& sweep, const daemon::SweepCut& cut) {
    if (stage)
      stage(sweep);
    const daemon::ProcessedSweep done = processor.process(sweep, cut);
    processor.prepare_next();
    ingest.take(processor.odometry().feedback());
    ++counters.seen;
    ++(done.estimate.failed ? counters.failed : counters.processed);
    if (observer)
      observer(done.estimate);
    results.take(done);
  };
  daemon::Ingest ingest(
      config, std::move(lidars), [&](Sweep& sweep, const daemon::SweepCut& cut) { process(ingest, sweep, cut); },
      [&](const HealthEvent& event) { results.take(event); });
  for (bool more = true; more;) {
    const daemon::Input input = recording.next(Duration::zero());
    ingest.take(input);
    more = !std::holds_alternative<daemon::EndOfInput>(input);
  }
  results.finish(ingest, processor, counters);
}

/// At the pace of the recording or a multiple of it, through the threads of the daemon.
void replay_live(const Config& config, LidarRouter lidars, Recording& recording, double speed, Results& results) {
  constexpr Duration kPatience = std::chrono::milliseconds{100};
  daemon::PacedInput paced(recording, speed);
  daemon::LivePipeline pipeline(config, std::move(lidars), paced, {.speed = speed});
  const auto take_events = [&] {
    while (const auto event = pipeline.next_health_event())
      results.take(*event);
  };
  while (!pipeline.finished()) {
    if (const auto done = pipeline.next(kPatience))
      results.take(*done);
    take_events();
  }
  pipeline.stop();
  take_events();
  results.finish(pipeline.ingest(), pipeline.processor(), pipeline.counters());
}

void run(const Arguments& arguments, const SweepStage& stage, const EstimateObserver& observer) {
  const MachineTime begin = MachineTime::now();
  const CaptureFolder folder = find_files(arguments.capture);
  check_output(arguments.output);
  check_inputs_outlive_the_run(arguments);
  const std::filesystem::path config_file = arguments.config.empty() ? folder.first_config() : arguments.config;
  const Config config = configuration(config_file, folder, arguments);
  check_faults(arguments.faults, config);
  LidarRouter lidars = value_or_fail(LidarRouter::open(config.lidars), ExitStatus::wrong_usage);

  std::vector<std::string> warnings;
  if (const auto changed = arguments.config.empty() ? folder.changed_config() : std::nullopt)
    warnings.push_back(*changed);
  RecordedInput input = open_input(arguments, folder, config, !config_file.empty(), warnings);
  for (const std::string& warning : warnings)
    say("locus-replay", "warning: " + warning);
  if (!input.taken.empty() && !arguments.quiet)
    fmt::print("{}\n", input.taken);

  Truth truth(arguments, folder, std::move(input.truth));
  const PlayOptions options{arguments.start, arguments.duration, arguments.faults, config.sweep.seed};
  Recording recording(std::move(input.lidars), std::move(input.motion), config, lidars, options);
  Results results(arguments, config, recording, std::move(truth), begin);
  if (arguments.realtime_speed)
    replay_live(config, std::move(lidars), recording, *arguments.realtime_speed, results);
  else
    replay(config, std::move(lidars), recording, results, stage, observer);
}

} // namespace

int replay_program(int argc, char** argv, const SweepStage& stage, const EstimateObserver& observer) {
  return exit_status_of("locus-replay", [&] {
    if (const std::optional<Arguments> arguments = parse_arguments(argc, argv))
      run(*arguments, stage, observer);
  });
}

} // namespace locus::tools
