// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/run_figures.hpp"

#include <algorithm>
#include <numeric>
#include <string_view>

#include <fmt/format.h>

namespace locus::tools {
namespace {

using nlohmann::ordered_json;

using daemon::rounded;

/// Describes a contradiction neutrally: whether the source or lidar is right is unknown.
std::string_view reason_of(const HealthEvent& event) {
  if (event.reason == HealthReason::disagreement)
    return "disagrees with lidar";
  return event.verdict.starts_with("and lidar disagree") ? "disagrees with lidar on turns" : to_string(event.reason);
}

/// Describes when and why a source was lost, and when it recovered.
std::string readable_health(const FinishedRun& run, SourceId source) {
  constexpr std::size_t kListed = 4; ///< changes shown; a flapping source would fill a page
  std::string text;
  std::size_t listed = 0;
  for (const HealthEvent& event : run.health_events) {
    if (event.source != source || listed++ >= kListed)
      continue;
    const double after_s = to_seconds(event.stamp - run.capture_start);
    text += event.healthy ? fmt::format(", back at {:.2f} s", after_s)
                          : fmt::format(", lost at {:.2f} s ({})", after_s, reason_of(event));
  }
  if (listed > kListed)
    text += fmt::format(" and {} more changes", listed - kListed);
  return text;
}

template <class T> ordered_json rounded_or_null(const std::optional<T>& value) {
  return value ? ordered_json(rounded(*value)) : ordered_json(nullptr);
}

void add_accuracy(const Accuracy& accuracy, ordered_json& json) {
  if (const auto& trajectory = accuracy.trajectory) {
    const ErrorStatistics& ape = trajectory->ape_m;
    json["ape_m"] = {
        {"max", rounded(ape.max)}, {"mean", rounded(ape.mean)}, {"std", rounded(ape.std)}, {"rmse", rounded(ape.rmse)}};
    json["rpe_10m_percent"] = rounded_or_null(trajectory->rpe_10m_percent);
    json["end_drift_m"] = rounded(trajectory->end_drift_m);
  }
  if (const auto& consistency = accuracy.consistency)
    json["covariance"] = {{"nees_10m", rounded_or_null(consistency->nees_10m)},
                          {"worst_sigma", rounded(consistency->worst_sigma)}};
  if (const auto& map = accuracy.map)
    json["map_error_m"] = {{"rmse", rounded_or_null(map->rmse_m)}, {"outliers", map->outliers}};
}

std::string readable(const Accuracy& accuracy, std::size_t estimates) {
  std::string text;
  if (const auto& trajectory = accuracy.trajectory) {
    text += fmt::format("truth      off by {:.3f} m in the mean, {:.3f} m at most; at the end {:.3f} m, unaligned",
                        trajectory->ape_m.mean, trajectory->ape_m.max, trajectory->end_drift_m);
    if (trajectory->rpe_10m_percent)
      text +=
          fmt::format("; {:.2f} % and {:.2f} deg over 10 m", *trajectory->rpe_10m_percent, *trajectory->rpe_10m_deg);
    if (trajectory->stamps.size() < estimates)
      text += fmt::format("; it covers {} of {} sweeps", trajectory->stamps.size(), estimates);
    text += '\n';
  }
  if (const auto& consistency = accuracy.consistency; consistency && consistency->nees_10m)
    text += fmt::format("covariance normalised squared error over 10 m {:.1f} (6: consistent; below: too large; "
                        "above: too small), worst position {:.1f} sigma off\n",
                        *consistency->nees_10m, consistency->worst_sigma);
  if (const auto& map = accuracy.map) {
    text += fmt::format("map truth  {} of {} points within 1 m", map->compared, map->compared + map->outliers);
    text += map->rmse_m ? fmt::format(", off by {:.3f} m rms\n", *map->rmse_m) : "\n";
  }
  return text;
}

} // namespace

ordered_json summary(const FinishedRun& run) {
  ordered_json json = to_json(run.figures);
  add_accuracy(run.accuracy, json);
  return json;
}

std::string readable(const FinishedRun& run) {
  const daemon::Figures& figures = run.figures;
  const daemon::SweepFigures& sweeps = figures.sweeps;
  const PacketCounters& packets = figures.ingest.total;
  const auto rejected = std::accumulate(packets.rejected.begin(), packets.rejected.end(), std::uint64_t{0});
  std::string text = fmt::format("recording  {:.1f} s", to_seconds(figures.duration));
  if (packets.data + packets.position + rejected > 0)
    text += fmt::format("; packets: {} data, {} position, {} lost, {} rejected", packets.data, packets.position,
                        packets.lost, rejected);
  text += '\n';
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    const daemon::IngestReport::Lidar& lidar = figures.ingest.lidars[i];
    if (!lidar.model.empty())
      text += fmt::format("{:10} {}, {} returns, {:.0f} rpm{}\n", figures.config.lidars[i].name, lidar.model,
                          lidar.return_mode, lidar.rotation_rate_rpm,
                          lidar.has_date ? fmt::format(", clock {}", lidar.pps) : "");
    if (const auto& clouds = lidar.clouds)
      text += fmt::format("{:10} {} clouds of {} used, {:.1f} per second, {:.0f} points each; times: {}, rings: {}\n",
                          figures.config.lidars[i].name, clouds->counters.used, clouds->counters.received,
                          1.0 / to_seconds(clouds->period),
                          static_cast<double>(clouds->counters.points) /
                              static_cast<double>(std::max<std::uint64_t>(clouds->counters.used, 1)),
                          to_string(clouds->timing), to_string(clouds->rings));
  }
  const std::vector<MotionSource>& sources = figures.config.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (const auto received = figures.ingest.sources[i].counters.received; received > 0)
      text += fmt::format("{:10} {} samples, used for {} sweeps{}\n", sources[i].name, received, sweeps.used_sweeps[i],
                          readable_health(run, SourceId{i}));
  }
  const Eigen::Vector3d end_m = sweeps.last.value_or(OdometryEstimate{}).T_odom_base.translation;
  text += fmt::format("path       {:.2f} m, ends at {:.3f} {:.3f} {:.3f} m\n", sweeps.path_m, end_m.x(), end_m.y(),
                      end_m.z());
  text +=
      fmt::format("time       {:.2f} ms per sweep from its cut, 99 % within {:.2f} ms; {:.1f} s in all, {:.0f} MB\n",
                  sweeps.process_ms.p50, sweeps.process_ms.p99, to_seconds(figures.spent.wall), daemon::peak_rss_mb());
  return text + readable(run.accuracy, sweeps.sweeps);
}

} // namespace locus::tools
