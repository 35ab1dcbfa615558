// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/verdicts.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "core/sources/motion_sources.hpp"
#include "daemon/calibration.hpp"
#include "locus_replay/lidar_doubts.hpp"

namespace locus::tools {
namespace {

/// Lists problems with the motion sources as a whole, a line each.
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
                      "that follows moving objects around the robot)",
                      name));
    else if (health.longest_refusal().is_worth_reporting())
      lines.push_back(fmt::format("motion source {} was rejected for {:.1f} s: it {}", name,
                                  to_seconds(health.longest_refusal().lasted),
                                  explanation(health.longest_refusal().reason)));
  }
  return lines;
}

} // namespace

std::optional<std::string> why_no_result(const PlayedRecording& played) {
  const std::string capture = played.capture.string();
  if (const std::optional<std::string> backwards = played.recording.runs_backwards())
    return fmt::format("{}: {}", capture, *backwards);
  if (played.figures.ingest.has_lidar_data())
    return std::nullopt;
  if (const std::string why = why_no_clouds(played.figures); !why.empty())
    return fmt::format("{}: no cloud that can be used: {}", capture, why);
  return fmt::format("{}: no valid data packet: {}", capture, why_no_data(played.recording, played.ingest.lidars()));
}

std::vector<std::string> warnings_about(const PlayedRecording& played) {
  std::vector<std::string> lines;
  if (played.figures.counters.seen == 0)
    lines.push_back(fmt::format("{}: there is lidar data but no whole sweep, which lasts 0.05 to 0.2 s; "
                                "record for longer, or check --start and --duration",
                                played.capture.string()));
  const auto add = [&](const std::vector<std::string>& more) { std::ranges::copy(more, std::back_inserter(lines)); };
  add(lidar_warnings(played.recording, played.ingest.lidars(), played.config.sweep));
  add(cloud_warnings(played.figures));
  add(source_verdicts(played.config, played.ingest.sources()));
  for (std::size_t i = 0; i < played.config.motion_sources.size(); ++i)
    if (const auto slow = daemon::slow_imu(played.figures.ingest.sources[i]))
      lines.push_back(fmt::format("motion source {} {}", played.config.motion_sources[i].name, *slow));
  for (std::size_t i = 0; i < played.config.motion_sources.size(); ++i)
    if (const std::string doubt = daemon::calibration_warning(played.figures, i); !doubt.empty())
      lines.push_back(fmt::format("motion source {} {}", played.config.motion_sources[i].name, doubt));
  if (std::string warning = daemon::lidar_mounting_warning(played.figures); !warning.empty())
    lines.push_back(std::move(warning));
  if (const auto warning = daemon::too_fast(played.config.odometry.motion, played.figures.sweeps.largest_speed_mps))
    lines.push_back(*warning);
  return lines;
}

} // namespace locus::tools
