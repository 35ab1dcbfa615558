// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/run_figures.hpp"

#include <algorithm>
#include <numeric>
#include <string_view>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::tools {
namespace {

using nlohmann::ordered_json;

using daemon::rounded;
using daemon::to_json;

ordered_json packets(const LidarRouter& lidars) {
  ordered_json packets{{"total", to_json(lidars.total())}};
  for (const LidarInput& lidar : lidars.lidars())
    packets[lidar.options().name] = to_json(lidar.counters());
  return packets;
}

/// As what the packets of each lidar were read.
ordered_json lidars(const LidarRouter& router) {
  ordered_json lidars;
  for (const LidarInput& lidar : router.lidars())
    lidars[lidar.options().name] = daemon::model_json(daemon::IngestReport::Lidar::of(lidar));
  return lidars;
}

ordered_json stages(const FinishedRun& run) {
  daemon::StageTimes totals;
  for (std::size_t i = 0; i < kStages; ++i)
    totals[i] = run.ingest.stages().total(static_cast<Stage>(i)) + run.processor.stages().total(static_cast<Stage>(i));
  return daemon::stages_json(totals, run.figures.sweeps());
}

ordered_json sources(const FinishedRun& run) {
  ordered_json sources = ordered_json::object();
  for (std::size_t i = 0; i < run.config.motion_sources.size(); ++i) {
    ordered_json& source = sources[run.config.motion_sources[i].name];
    const HealthMonitor& health = run.ingest.sources().health(SourceId{i});
    source = to_json(health.counters(), run.figures.sums().used_sweeps[i]);
    if (const std::string_view verdict = health.verdict(); !verdict.empty())
      source["verdict"] = verdict;
  }
  return sources;
}

/// Who is right when a source and lidar contradict each other is not known.
std::string_view reason_of(const HealthEvent& event) {
  if (event.reason == HealthReason::disagreement)
    return "disagrees with lidar";
  return event.verdict.starts_with("and lidar disagree") ? "disagrees with lidar on turns" : to_string(event.reason);
}

/// When a source was lost and why, and when it came back.
std::string readable_health(const FinishedRun& run, SourceId source) {
  constexpr std::size_t kTold = 4; ///< a source that flaps is not worth a page
  std::string text;
  std::size_t told = 0;
  for (const HealthEvent& event : run.figures.health_events()) {
    if (event.source != source || told++ >= kTold)
      continue;
    const double after_s = to_seconds(event.stamp - run.capture_start);
    text += event.healthy ? fmt::format(", back at {:.2f} s", after_s)
                          : fmt::format(", lost at {:.2f} s ({})", after_s, reason_of(event));
  }
  if (told > kTold)
    text += fmt::format(" and {} more changes", told - kTold);
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
    text += fmt::format("truth      off by {:.3f} m in the mean, {:.3f} m at most; unaligned, {:.3f} m at the end",
                        trajectory->ape_m.mean, trajectory->ape_m.max, trajectory->end_drift_m);
    if (trajectory->rpe_10m_percent)
      text +=
          fmt::format("; {:.2f} % and {:.2f} deg over 10 m", *trajectory->rpe_10m_percent, *trajectory->rpe_10m_deg);
    if (trajectory->stamps.size() < estimates)
      text += fmt::format("; it speaks of {} of {} sweeps", trajectory->stamps.size(), estimates);
    text += '\n';
  }
  if (const auto& consistency = accuracy.consistency; consistency && consistency->nees_10m)
    text += fmt::format(
        "honesty    normalised squared error over 10 m {:.1f} (6: the covariances are right; below: too cautious; "
        "above: too sure), worst position {:.1f} sigma off\n",
        *consistency->nees_10m, consistency->worst_sigma);
  if (const auto& map = accuracy.map) {
    text += fmt::format("map truth  {} of {} points within 1 m", map->compared, map->compared + map->outliers);
    text += map->rmse_m ? fmt::format(", off by {:.3f} m rms\n", *map->rmse_m) : "\n";
  }
  return text;
}

} // namespace

void RunFigures::take(const daemon::ProcessedSweep& sweep) {
  const OdometryEstimate& estimate = sweep.estimate;
  if (sweeps() > 0)
    path_m_ += (estimate.T_odom_base.translation - last_T_odom_base_.translation).norm();
  last_T_odom_base_ = estimate.T_odom_base;
  largest_speed_mps_ = std::max(largest_speed_mps_, estimate.twist_base.head<3>().norm());
  wall_ms_.push_back(static_cast<float>(1e3 * to_seconds(sweep.took.wall)));
  cpu_ms_.push_back(static_cast<float>(1e3 * to_seconds(sweep.took.cpu)));
  sums_.add(sweep);
}

daemon::Percentiles RunFigures::percentiles(std::span<const float> values) {
  const Quantiles quantiles({values.begin(), values.end()});
  return {quantiles.at(0.5), quantiles.at(0.9), quantiles.at(0.99), quantiles.at(1.0)};
}

ordered_json summary(const FinishedRun& run) {
  ordered_json json{{"version", LOCUS_VERSION},
                    {"capture", run.capture},
                    {"config_sha256", config_sha256(run.config)},
                    {"threads", run.config.odometry.threads},
                    {"isa", std::string(to_string(run.config.odometry.isa))},
                    {"duration_s", rounded(to_seconds(run.duration))},
                    {"wall_s", rounded(to_seconds(run.spent.wall))},
                    {"cpu_s", rounded(to_seconds(run.spent.cpu))},
                    {"peak_rss_mb", rounded(daemon::peak_rss_mb())},
                    {"packets", packets(run.ingest.lidars())},
                    {"lidars", lidars(run.ingest.lidars())},
                    {"sweeps", to_json(run.sweeps)},
                    {"process_ms", to_json(run.figures.process_ms())},
                    {"process_cpu_ms", to_json(run.figures.process_cpu_ms())},
                    {"stage_ms", stages(run)},
                    {"points", points_json(run.figures.sums())},
                    {"iterations_mean", iterations_json(run.figures.sums())},
                    {"largest_speed_mps", rounded(run.figures.largest_speed_mps())},
                    {"sources", sources(run)}};
  add_accuracy(run.accuracy, json);
  return json;
}

std::string readable(const FinishedRun& run) {
  const PacketCounters packets = run.ingest.lidars().total();
  const auto rejected = std::accumulate(packets.rejected.begin(), packets.rejected.end(), std::uint64_t{0});
  const daemon::Percentiles wall_ms = run.figures.process_ms();
  const Eigen::Vector3d& end_m = run.figures.last_T_odom_base().translation;
  std::string text = fmt::format("recording  {:.1f} s; packets: {} data, {} position, {} lost, {} rejected\n",
                                 to_seconds(run.duration), packets.data, packets.position, packets.lost, rejected);
  for (const LidarInput& lidar : run.ingest.lidars().lidars()) {
    const velodyne::Decoder& decoder = lidar.decoder();
    if (decoder.model())
      text += fmt::format("{:10} {}, {} returns, {:.0f} rpm\n", lidar.options().name, to_string(*decoder.model()),
                          to_string(*decoder.return_mode()), decoder.rotation_rate_rpm());
  }
  text += fmt::format("sweeps     {} seen: {} processed, {} dropped, {} failed\n", run.sweeps.seen,
                      run.sweeps.processed, run.sweeps.dropped, run.sweeps.failed);
  for (std::size_t i = 0; i < run.config.motion_sources.size(); ++i) {
    if (const auto received = run.ingest.sources().health(SourceId{i}).counters().received; received > 0)
      text += fmt::format("{:10} {} samples, used for {} sweeps{}\n", run.config.motion_sources[i].name, received,
                          run.figures.sums().used_sweeps[i], readable_health(run, SourceId{i}));
  }
  text += fmt::format("path       {:.2f} m, ends at {:.3f} {:.3f} {:.3f} m\n", run.figures.path_m(), end_m.x(),
                      end_m.y(), end_m.z());
  text += fmt::format("time       {:.2f} ms a sweep from its cut, 99 % within {:.2f} ms; {:.1f} s in all, {:.0f} MB\n",
                      wall_ms.p50, wall_ms.p99, to_seconds(run.spent.wall), daemon::peak_rss_mb());
  return text + readable(run.accuracy, run.figures.sweeps());
}

} // namespace locus::tools
