// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/results.hpp"

#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "locus_replay/failure.hpp"
#include "locus_replay/map_file.hpp"
#include "locus_replay/output_file.hpp"
#include "locus_replay/print_message.hpp"
#include "locus_replay/recorded_input.hpp"
#include "locus_replay/report.hpp"
#include "locus_replay/report_map.hpp"
#include "locus_replay/verdicts.hpp"

namespace locus::tools {
namespace {

/// Removes old results, so that none is mistaken for the result of this run, however it ends. Keeps links, which the
/// user made deliberately.
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
    tools::print_message("locus-replay", "warning: " + line);
}

} // namespace

Results::Results(const Arguments& arguments, const Config& config, const Recording& recording, Truth truth,
                 const daemon::MachineTime& begin)
    : arguments_(arguments), config_(config), recording_(recording), begin_(begin),
      odometry_(made(arguments.output), config.motion_sources), truth_(std::move(truth)), progress_(!arguments.quiet) {}

void Results::add(const daemon::ProcessedSweep& sweep) {
  odometry_.write(sweep.estimate);
  tally_.add(sweep);
  sweeps_.push_back(record_of(sweep));
  truth_.add(sweep.estimate);
  progress_.show(recording_.progress());
}

void Results::finish(const daemon::Ingest& ingest, const daemon::SweepProcessor& processor,
                     const daemon::SweepCounters& sweeps) {
  const daemon::MachineTime spent = daemon::MachineTime::now() - begin_;
  progress_.wipe();
  odometry_.close();
  std::vector<SurfacePoint> map;
  read_planes(processor.odometry().map().fine(), map);
  const Accuracy accuracy =
      sweeps.seen > 0 ? truth_.compare(map, recording_.clock_steps(), !arguments_.quiet) : Accuracy{};
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
  const PlayedRecording played{arguments_.capture, config_, recording_, ingest, figures};
  if (const std::optional<std::string> why = why_no_result(played)) {
    remove_results(arguments_.output, false);
    throw Failure(ExitStatus::failed, *why);
  }
  write_map(arguments_.output / "map.pcd", map);
  write_report(arguments_.output / "report.html",
               {summary, config_, recording_.capture_start(), figures.sweeps.path_m, sweeps_,
                visible_surfaces(processor.odometry().map()), truth_.trajectory(), accuracy.trajectory});
  warn(warnings_about(played));
  warn(accuracy.warnings);
  if (!arguments_.quiet)
    fmt::print("{}results    {}\nrun        {}\n", readable(run), arguments_.output.string(), summary_line(figures));
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
