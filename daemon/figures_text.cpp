// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "core/base/pose.hpp"
#include "daemon/calibration.hpp"
#include "daemon/figures.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::daemon {
namespace {

std::uint64_t sum(const auto& counts) { return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0}); }

std::string bar(double share) {
  constexpr int kLength = 6;
  std::string text(kLength, '.');
  for (int i = 0; i < kLength && i < std::lround(share * 2 * kLength); ++i)
    text[static_cast<std::size_t>(i)] = '#';
  return text;
}

std::string pose_text(const std::optional<OdometryEstimate>& last) {
  if (!last)
    return "pose        none yet\n";
  const Eigen::Vector3d& p = last->T_odom_base.translation;
  const Eigen::Vector3d a = to_rpy_rad(last->T_odom_base.rotation) / kRadPerDeg;
  const auto sigma = [&](int axis, double unit) {
    const double value = unit * std::sqrt(std::max(0.0, last->pose_covariance(axis, axis)));
    return axis < 3 ? value : std::min(value, 180.0);
  };
  std::string text = fmt::format("position    {:9.3f} {:9.3f} {:9.3f} m     +- {:.3f} {:.3f} {:.3f}\n"
                                 "attitude    {:9.2f} {:9.2f} {:9.2f} deg   +- {:.2f} {:.2f} {:.2f}\n",
                                 p[0], p[1], p[2], sigma(0, 1), sigma(1, 1), sigma(2, 1), a[0], a[1], a[2],
                                 sigma(3, 1 / kRadPerDeg), sigma(4, 1 / kRadPerDeg), sigma(5, 1 / kRadPerDeg));
  text += "observable ";
  for (std::size_t i = 0; i < kAxes.size(); ++i)
    text += fmt::format(" {} {}", kAxes[i], bar(last->observability[static_cast<Eigen::Index>(i)]));
  if (last->beginning)
    text += fmt::format("\nbeginning   {}", to_string(*last->beginning));
  return text + '\n';
}

/// Lists rejections by reason, using the names of `E`: "sender 12, time 3".
template <class E> std::string reasons(const auto& counts) {
  std::string text;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0)
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", to_string(static_cast<E>(i)), counts[i]);
  }
  return text;
}

std::string silence_text(Stamp last_received) {
  const std::optional<Duration> silence = time_since(last_received);
  if (!silence)
    return "always";
  const double silence_s = to_seconds(*silence);
  return silence_s < 1000 ? fmt::format("{:.1f} s", silence_s) : fmt::format("{:.1f} h", silence_s / 3600);
}

/// Formats a line for clouds in the columns of packets.
std::string clouds_text(const LidarOptions& options, const IngestReport::Lidar& lidar, std::uint64_t drops) {
  const IngestReport::Clouds& clouds = *lidar.clouds;
  const CloudCounters& counters = clouds.counters;
  std::string text =
      fmt::format("{:<9.8}{:<12}{:>5.0f}{:>10}{:>8}{:>9}{:>9}{:>8}\n", options.name,
                  counters.used > 0 ? "clouds" : "no data", 60 / to_seconds(clouds.period), counters.used, drops,
                  sum(counters.refused), counters.reordered, silence_text(lidar.last_received));
  if (const std::string refused = reasons<CloudError>(counters.refused); !refused.empty())
    text += fmt::format("{:<9}rejected: {}\n", "", refused);
  if (const std::string problem = problem_of(options, lidar); !problem.empty())
    text += fmt::format("{:<9}{}\n", "", problem);
  return text;
}

std::string lidars_text(const Figures& figures) {
  std::string text = fmt::format("\n{:<9}{:<12}{:>5}{:>10}{:>8}{:>9}{:>9}{:>8} {}\n", "lidar", "model", "rpm",
                                 "packets", "lost", "rejected", "disorder", "silent", "pps");
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    const LidarOptions& options = figures.config.lidars[i];
    const IngestReport::Lidar& lidar = figures.ingest.lidars[i];
    if (lidar.clouds) {
      text += clouds_text(options, lidar, figures.live->cloud_drops[i]);
      continue;
    }
    const PacketCounters& packets = lidar.packets;
    text +=
        fmt::format("{:<9.8}{:<12}{:>5.0f}{:>10}{:>8}{:>9}{:>9}{:>8} {:.8}\n", options.name,
                    lidar.model.empty() ? "no data" : lidar.model, lidar.rotation_rate_rpm, packets.data, packets.lost,
                    sum(packets.rejected), packets.reordered, silence_text(lidar.last_received), lidar.pps);
    if (const std::string refused = reasons<PacketError>(packets.rejected); !refused.empty())
      text += fmt::format("{:<9}rejected: {}{}\n", "", refused,
                          lidar.refused_ip ? "; the last sender: " + dotted(*lidar.refused_ip) : "");
    if (const std::string problem = problem_of(options, lidar); !problem.empty())
      text += fmt::format("{:<9}{}\n", "", problem);
  }
  if (const std::string warning = lidar_mounting_warning(figures); !warning.empty())
    text += fmt::format("{:<9}{}\n", "", warning);
  return text;
}

std::string sources_text(const Figures& figures) {
  const std::vector<MotionSource>& sources = figures.config.motion_sources;
  if (sources.empty())
    return "";
  std::string text = fmt::format("\n{:<12}{:<12}{:>12}{:>12}{:>12}{:>10}{:>9}\n", "source", "health", "samples",
                                 "rejected", "for sweeps", "changes", "silent");
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const IngestReport::Source& source = figures.ingest.sources[i];
    const SourceCounters& counters = source.counters;
    text += fmt::format("{:<12.11}{:<12}{:>12}{:>12}{:>12}{:>10}{:>9}\n", sources[i].name, health_of(source),
                        counters.received, sum(counters.rejected), figures.sweeps.used_sweeps[i],
                        counters.health_changes, silence_text(source.last_received));
    if (const std::string refused = reasons<HealthReason>(counters.rejected); !refused.empty())
      text += fmt::format("{:<12}rejected: {}\n", "", refused);
    if (const std::string verdict = verdict_on(source, true); !verdict.empty())
      text += fmt::format("{:<12}{}\n", "", verdict);
    if (const std::string doubt = calibration_warning(figures, i); !doubt.empty())
      text += fmt::format("{:<12}{}\n", "", doubt);
  }
  return text;
}

std::string recording_text(const std::optional<Recorder::Status>& recording) {
  if (!recording)
    return "";
  return fmt::format("recording   {}, {:.0f} MB   {} inputs   {} dropped\n",
                     !recording->problem.empty() ? "none: " + recording->problem
                     : recording->run.empty()    ? "nothing yet"
                                                 : recording->run.string(),
                     1e-6 * static_cast<double>(recording->bytes), recording->recorded, recording->dropped);
}

std::string incidents_text(const std::optional<Incidents::Status>& incidents) {
  if (!incidents || (incidents->last.empty() && incidents->suppressed == 0 && incidents->problem.empty()))
    return "";
  return fmt::format("incident    {}{}\n",
                     !incidents->problem.empty() ? "none: " + incidents->problem
                     : incidents->last.empty()   ? "none stored"
                                                 : incidents->last.filename().string(),
                     incidents->suppressed > 0 ? fmt::format(", {} more within five minutes", incidents->suppressed)
                                               : "");
}

/// Names the source that everything else contradicted most, with the test ratio.
std::string worst_source_text(const Figures& figures) {
  const auto& ratios = figures.sweeps.largest_test_ratios;
  const auto worst = std::ranges::max_element(ratios);
  if (*worst == 0.0)
    return "no source compared";
  const auto source = static_cast<std::size_t>(worst - ratios.begin());
  return fmt::format("largest test ratio {:.2f} ({})", *worst, figures.config.motion_sources[source].name);
}

} // namespace

std::string summary_line(const Figures& figures) {
  const SweepCounters& counters = figures.counters;
  return fmt::format("{} sweeps: {} dropped, {} failed, {} dead reckoned, {} without a source; {}; trajectory {}",
                     counters.seen, counters.dropped, counters.failed, figures.sweeps.dead_reckoned,
                     figures.sweeps.without_source, worst_source_text(figures), figures.sweeps.trajectory_digest);
}

std::string to_text(const Figures& figures) {
  const Figures::Live& live = *figures.live;
  const SweepFigures& sweeps = figures.sweeps;
  const SweepCounters& counters = figures.counters;
  const Percentiles& wall = sweeps.process_ms;
  const double up_s = to_seconds(figures.duration);
  std::string text =
      fmt::format("locusd {}   {}   up {:.0f} s   flat ground {}\n", LOCUS_VERSION,
                  sweeps.last ? to_string(sweeps.last->state) : "waiting", up_s, to_string(live.flat_ground));
  text += fmt::format(
      "rate        {:.1f} Hz   last {}\n", sweeps.rate_hz,
      sweeps.last ? fmt::format("{:.0f} ms ago", 1e3 * to_seconds(time_since(sweeps.last->stamp).value_or(Duration{})))
                  : "never");
  text += fmt::format("per sweep   {:.2f} ms   90 % {:.2f}   99 % {:.2f}   worst {:.2f}\n", wall.p50, wall.p90,
                      wall.p99, wall.max);
  text += fmt::format("sweeps      {} seen   {} processed   {} dropped   {} failed   {} kernel drops\n", counters.seen,
                      counters.processed, counters.dropped, counters.failed, live.kernel_drops);
  if (live.filtered > 0)
    text += fmt::format("flood       {} datagrams of other senders were filtered by the kernel\n", live.filtered);
  text += fmt::format("machine     {:.1f} % of a core since the start   {:.0f} MB at most\n",
                      up_s > 0 ? 100 * to_seconds(figures.spent.cpu) / up_s : 0.0, peak_rss_mb());
  text +=
      fmt::format("dds         {}, domain {}, interface {}\n", live.link.connected ? "up" : "not connected, retrying",
                  figures.config.dds.domain, figures.config.dds.interface);
  return text + recording_text(live.recording) + incidents_text(live.incidents) + pose_text(sweeps.last) +
         lidars_text(figures) + sources_text(figures);
}

} // namespace locus::daemon
