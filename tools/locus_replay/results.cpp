// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/results.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"
#include "locus_replay/lidar_doubts.hpp"
#include "locus_replay/map_file.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_replay/recorded_input.hpp"
#include "locus_replay/report.hpp"
#include "locus_replay/report_map.hpp"
#include "locus_replay/say.hpp"

namespace locus::tools {
namespace {

/// So that nothing of an earlier run is taken for the result of this one, however it ends. A link is the user's, who
/// wants it to lead somewhere.
void remove_results(const std::filesystem::path& folder, bool summary_too) {
  std::error_code ignored;
  for (const char* const name : kResultFiles) {
    const bool is_wanted = name == kResultFiles.front() && !summary_too;
    if (!is_wanted && std::filesystem::is_regular_file(std::filesystem::symlink_status(folder / name, ignored)))
      std::filesystem::remove(folder / name, ignored);
  }
}

const std::filesystem::path& made(const std::filesystem::path& folder) {
  make_folder(folder);
  remove_results(folder, true);
  return folder;
}

void warn(const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    tools::say("locus-replay", "warning: " + line);
}

/// What is wrong with motion sources altogether, a line each.
std::vector<std::string> source_verdicts(const Config& config, const MotionSources& sources) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::string& name = config.motion_sources[i].name;
    const HealthMonitor& health = sources.health(SourceId{i});
    const bool is_too_fast = 10 * health.counters().rejected_as(HealthReason::speed) > health.counters().received;
    const bool is_doubted = !health.healthy() && health.counters().rejected_as(HealthReason::self_check) > 0;
    if (const std::string_view verdict = health.verdict(); !verdict.empty())
      lines.push_back(fmt::format("motion source {} {}", name, verdict));
    else if (is_too_fast)
      lines.push_back(fmt::format("motion source {} {}", name, kTooFast));
    else if (is_doubted)
      lines.push_back(
          fmt::format("motion source {} and lidar disagreed on how the robot turns, and it was not yet used again at "
                      "the end (possible causes: T_base_source, the unit (rad/s) or the stamps of the gyro, or lidar "
                      "that follows what moves around the robot)",
                      name));
  }
  return lines;
}

} // namespace

Results::Results(const Arguments& arguments, const Config& config, const Recording& recording, Truth truth,
                 const daemon::MachineTime& begin)
    : arguments_(arguments), config_(config), recording_(recording), begin_(begin),
      odometry_(made(arguments.output), config.motion_sources), truth_(std::move(truth)), progress_(!arguments.quiet) {}

void Results::take(const daemon::ProcessedSweep& sweep) {
  odometry_.write(sweep.estimate);
  tally_.take(sweep);
  sweeps_.push_back(record_of(sweep));
  truth_.take(sweep.estimate);
  progress_.show(recording_.progress());
}

void Results::finish(const daemon::Ingest& ingest, const daemon::SweepProcessor& processor,
                     const daemon::SweepCounters& sweeps) {
  const daemon::MachineTime spent = daemon::MachineTime::now() - begin_;
  progress_.wipe();
  odometry_.close();
  const bool has_data = ingest.lidars().total().data > 0;
  std::vector<SurfacePoint> map;
  read_planes(processor.odometry().map().fine(), map);
  const Accuracy accuracy = sweeps.seen > 0 ? truth_.compare(map, !arguments_.quiet) : Accuracy{};
  daemon::Figures figures{.config = config_,
                          .capture = arguments_.capture.string(),
                          .duration = recording_.duration(),
                          .spent = spent,
                          .counters = sweeps,
                          .sweeps = tally_.figures()};
  figures.ingest.read(ingest);
  const FinishedRun run{figures, health_events_, recording_.capture_start(), accuracy};
  const nlohmann::ordered_json summary = write_summary(run);
  warn(recording_.warnings());
  const std::optional<std::string> backwards = recording_.runs_backwards();
  if (!has_data || backwards) {
    remove_results(arguments_.output, false);
    if (backwards)
      throw Failure(ExitStatus::failed, fmt::format("{}: {}", arguments_.capture.string(), *backwards));
    throw Failure(ExitStatus::failed, fmt::format("{}: no valid data packet: {}", arguments_.capture.string(),
                                                  why_no_data(recording_, ingest.lidars())));
  }
  write_map(arguments_.output / "map.pcd", map);
  write_report(arguments_.output / "report.html",
               {summary, config_, recording_.capture_start(), figures.sweeps.path_m, sweeps_,
                visible_surfaces(processor.odometry().map()), truth_.trajectory(), accuracy.trajectory});
  if (sweeps.seen == 0)
    warn({fmt::format("{}: there is lidar data and no whole sweep, which takes 0.05 to 0.2 s; look at --start and "
                      "--duration",
                      arguments_.capture.string())});
  warn(lidar_warnings(recording_, ingest.lidars(), config_.sweep));
  warn(source_verdicts(config_, ingest.sources()));
  if (const auto warning = daemon::too_fast(config_.odometry.motion, figures.sweeps.largest_speed_mps))
    warn({*warning});
  warn(accuracy.warnings);
  if (!arguments_.quiet)
    fmt::print("{}results    {}\n", readable(run), arguments_.output.string());
  if (!accuracy.problems.empty())
    throw Failure(ExitStatus::failed, fmt::format("{}", fmt::join(accuracy.problems, "\n")));
}

nlohmann::ordered_json Results::write_summary(const FinishedRun& run) const {
  OutputFile file(arguments_.output / "summary.json");
  nlohmann::ordered_json json = summary(run);
  if (const std::optional<double> raised_deg = raised_by_deg(arguments_))
    json["kitti_vertical_angle_added_deg"] = *raised_deg;
  file.print("{}\n", json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  file.close();
  return json;
}

} // namespace locus::tools
