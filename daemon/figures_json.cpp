// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "config/config_yaml.hpp"
#include "core/base/pose.hpp"
#include "daemon/calibration.hpp"
#include "daemon/figures.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

template <class T> ordered_json text_or_null(const std::optional<T>& value, const auto& to_text) {
  return value ? ordered_json(std::string{to_text(*value)}) : ordered_json(nullptr);
}

ordered_json ms_since(Stamp then) {
  const std::optional<Duration> since = time_since(then);
  return since ? ordered_json(rounded(1e3 * to_seconds(*since))) : ordered_json(nullptr);
}

/// Formats counts by the names of `E`: the first `always` in any case, the others if nonzero.
template <class E, std::size_t kCount>
ordered_json counts_json(const std::array<std::uint64_t, kCount>& counts, std::size_t always = kCount) {
  ordered_json json;
  for (std::size_t i = 0; i < kCount; ++i) {
    if (i < always || counts[i] > 0)
      json[std::string{to_string(static_cast<E>(i))}] = counts[i];
  }
  return json;
}

ordered_json percentiles_json(const Percentiles& p) {
  return {{"p50", rounded(p.p50)}, {"p90", rounded(p.p90)}, {"p99", rounded(p.p99)}, {"max", rounded(p.max)}};
}

ordered_json packets_json(const PacketCounters& counters) {
  return {{"received", counters.received},
          {"data", counters.data},
          {"position", counters.position},
          {"lost", counters.lost},
          {"reordered", counters.reordered},
          {"clock_steps", counters.clock_steps},
          {"rejected", counts_json<PacketError>(counters.rejected)}};
}

ordered_json all_packets_json(const Figures& figures) {
  ordered_json json{{"total", packets_json(figures.ingest.total)}};
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    if (!figures.config.lidars[i].gives_clouds())
      json[figures.config.lidars[i].name] = packets_json(figures.ingest.lidars[i].packets);
  }
  if (figures.live)
    json["kernel_drops"] = figures.live->kernel_drops;
  return json;
}

ordered_json clouds_json(const IngestReport::Clouds& clouds) {
  std::vector<std::string> doubts;
  for (std::size_t i = 0; i < kCloudDoubts; ++i) {
    if (clouds.doubts[i])
      doubts.emplace_back(to_string(static_cast<CloudDoubt>(i)));
  }
  const CloudCounters& counters = clouds.counters;
  return {{"received", counters.received},
          {"used", counters.used},
          {"reordered", counters.reordered},
          {"clock_steps", counters.clock_steps},
          {"refused", counts_json<CloudError>(counters.refused)},
          {"points", counters.points},
          {"nan", counters.nan},
          {"origin", counters.origin},
          {"untimed", counters.untimed},
          {"rate_hz", rounded(1.0 / to_seconds(clouds.period))},
          {"times", to_string(clouds.timing)},
          {"rings", to_string(clouds.rings)},
          {"doubts", doubts}};
}

/// Formats a lidar that publishes clouds: their counters and, for a service, the arrival of the last one.
ordered_json cloud_lidar_json(const Figures& figures, std::size_t i) {
  const LidarOptions& options = figures.config.lidars[i];
  const IngestReport::Lidar& lidar = figures.ingest.lidars[i];
  ordered_json json{{"topic", options.topic}, {"clouds", clouds_json(lidar.clouds.value_or(IngestReport::Clouds{}))}};
  if (!figures.live)
    return json;
  json["clouds"]["dropped"] = figures.live->cloud_drops[i];
  json.update({{"writers", figures.live->link.lidars[i].writers},
               {"refused", figures.live->link.lidars[i].refused},
               {"heard_ms_ago", ms_since(lidar.last_received)},
               {"problem", problem_of(options, lidar)}});
  return json;
}

/// Formats a lidar's model and return mode, null before the first valid packet; for a service also its reception.
ordered_json lidar_json(const Figures& figures, std::size_t i) {
  const auto text = [](std::string_view word) { return word.empty() ? ordered_json(nullptr) : ordered_json(word); };
  const LidarOptions& options = figures.config.lidars[i];
  const IngestReport::Lidar& lidar = figures.ingest.lidars[i];
  ordered_json json{{"model", text(lidar.model)},
                    {"return_mode", text(lidar.return_mode)},
                    {"rpm", rounded(lidar.rotation_rate_rpm)}};
  if (figures.live)
    json.update({{"port", options.port},
                 {"source_ip", text_or_null(lidar.source_ip, dotted)},
                 {"refused_ip", text_or_null(lidar.refused_ip, dotted)},
                 {"heard_ms_ago", ms_since(lidar.last_received)},
                 {"pps", lidar.pps},
                 {"problem", problem_of(options, lidar)}});
  return json;
}

/// Formats an innovation: m/s along and rad/s about x, y, z of the base.
ordered_json innovation_json(const SourceReport& report) {
  const Vector6 sd = report.innovation.variance.cwiseSqrt();
  return {{"value", std::vector<double>(report.innovation.value.begin(), report.innovation.value.end())},
          {"sd", std::vector<double>(sd.begin(), sd.end())},
          {"test_ratio", rounded(report.test_ratio)}};
}

ordered_json source_json(const Figures& figures, std::size_t i) {
  constexpr std::size_t kAlwaysListed = 7; ///< reasons; the others are rare and listed only if they occur
  const IngestReport::Source& source = figures.ingest.sources[i];
  ordered_json json{{"received", source.counters.received},
                    {"used_sweeps", figures.sweeps.used_sweeps[i]},
                    {"largest_test_ratio", rounded(figures.sweeps.largest_test_ratios[i])},
                    {"rejected", counts_json<HealthReason>(source.counters.rejected, kAlwaysListed)},
                    {"health_changes", source.counters.health_changes}};
  const std::string verdict = verdict_on(source, figures.live.has_value());
  if (figures.live || !verdict.empty())
    json["verdict"] = verdict;
  const MotionSource& options = figures.config.motion_sources[i];
  if (figures.sweeps.last && figures.sweeps.last->sources[i].learned && options.calibration != Calibration::off) {
    json["learned"] = learned_json(options, *figures.sweeps.last->sources[i].learned, false, findings_on(figures, i));
    if (const auto T_base_source = mounting_with(options, source.gyro_axes))
      json["learned"]["calibrated"] = {{"T_base_source", mounting_json(*T_base_source)}};
  }
  if (const std::string warning = calibration_warning(figures, i); !warning.empty())
    json["calibration_warning"] = warning;
  if (figures.live && figures.sweeps.last) {
    const SourceReport& report = figures.sweeps.last->sources[i];
    json["innovation"] = innovation_json(report);
    json["last_used_ms_ago"] = ms_since(report.last_used);
  }
  if (figures.live)
    json.update({{"health", health_of(source)},
                 {"heard_ms_ago", ms_since(source.last_received)},
                 {"writers", figures.live->link.sources[i].writers},
                 {"refused", figures.live->link.sources[i].refused},
                 {"health_refused", figures.live->link.sources[i].health_refused}});
  return json;
}

ordered_json estimate_json(const SweepFigures& sweeps) {
  if (!sweeps.last)
    return {{"rate_hz", rounded(sweeps.rate_hz)}, {"state", "waiting"}};
  const OdometryEstimate& last = *sweeps.last;
  const Eigen::Vector3d& p = last.T_odom_base.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(last.T_odom_base.rotation) / kRadPerDeg;
  std::vector<double> covariance;
  covariance.reserve(36);
  for (int i = 0; i < 36; ++i)
    covariance.push_back(last.pose_covariance(i / 6, i % 6));
  return {{"rate_hz", rounded(sweeps.rate_hz)},
          {"state", to_string(last.state)},
          {"beginning", last.beginning ? ordered_json(to_string(*last.beginning)) : ordered_json()},
          {"age_ms", ms_since(last.stamp)},
          {"t_ns", to_ns(last.stamp)},
          {"pose", {{"xyz_m", {p.x(), p.y(), p.z()}}, {"rpy_deg", {rpy_deg.x(), rpy_deg.y(), rpy_deg.z()}}}},
          {"covariance", covariance},
          {"observability", std::vector<double>(last.observability.begin(), last.observability.end())}};
}

/// Formats sweep statistics; means are over all sweeps.
ordered_json sweeps_json(const SweepFigures& sweeps) {
  const auto mean = [&](double sum) {
    return rounded(sum / static_cast<double>(std::max<std::uint64_t>(1, sweeps.sweeps)));
  };
  ordered_json stages;
  for (std::size_t i = 0; i < kStages; ++i)
    stages[std::string{to_string(static_cast<Stage>(i))}] = mean(1e3 * to_seconds(sweeps.stages[i]));
  return {{"process_ms", percentiles_json(sweeps.process_ms)},
          {"process_cpu_ms", percentiles_json(sweeps.process_cpu_ms)},
          {"stage_ms", stages},
          {"points", {{"raw_mean", mean(sweeps.raw_points)}, {"filtered_mean", mean(sweeps.filtered_points)}}},
          {"iterations_mean",
           {{"scan_to_scan", mean(sweeps.scan_to_scan_iterations)},
            {"scan_to_submap", mean(sweeps.scan_to_submap_iterations)}}},
          {"largest_speed_mps", rounded(sweeps.largest_speed_mps)}};
}

ordered_json live_json(const Figures& figures, const Figures::Live& live) {
  const SweepBuilder::Counters& builder = figures.ingest.sweeps;
  ordered_json json{{"flat_ground", to_string(live.flat_ground)},
                    {"dropped",
                     {{"late_packets", builder.late_packets},
                      {"overflowed_points", builder.overflowed_points},
                      {"motion_samples", live.motion_drops},
                      {"flood_datagrams", live.filtered},
                      {"flat_ground_messages", live.link.flat_ground_refused},
                      {"estimates_unfetched", live.unfetched},
                      {"estimates_unpublished", live.unpublished}}},
                    {"restarts", builder.restarts},
                    {"resets", live.resets}};
  if (const auto& recording = live.recording)
    json["recording"] = {
        {"run", recording->run.string()},  {"mb", rounded(1e-6 * static_cast<double>(recording->bytes))},
        {"recorded", recording->recorded}, {"dropped", recording->dropped},
        {"unfit", recording->unfit},       {"problem", recording->problem}};
  if (const auto& incidents = live.incidents)
    json["incidents"] = {{"last", incidents->last.string()}, {"writing", incidents->writing.string()},
                         {"kept", incidents->stored},        {"suppressed", incidents->suppressed},
                         {"dropped", incidents->dropped},    {"problem", incidents->problem},
                         {"refusal", incidents->refusal}};
  json["dds"] = {{"connected", live.link.connected},
                 {"domain", figures.config.dds.domain},
                 {"interface", figures.config.dds.interface},
                 {"attempts", live.link.attempts},
                 {"problem", live.link.connected ? "" : live.link.problem}};
  return json;
}

} // namespace

ordered_json to_json(const Figures& figures) {
  const Config& config = figures.config;
  const SweepCounters& counters = figures.counters;
  ordered_json json{{"version", LOCUS_VERSION},
                    {"capture", figures.capture},
                    {"config_sha256", config_sha256(config)},
                    {"threads", config.odometry.threads},
                    {"isa", to_string(config.odometry.isa)},
                    {"duration_s", rounded(to_seconds(figures.duration))},
                    {"wall_s", rounded(to_seconds(figures.spent.wall))},
                    {"cpu_s", rounded(to_seconds(figures.spent.cpu))},
                    {"peak_rss_mb", rounded(peak_rss_mb())}};
  if (figures.live)
    json.update(estimate_json(figures.sweeps));
  json["packets"] = all_packets_json(figures);
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    json["lidars"][config.lidars[i].name] =
        config.lidars[i].gives_clouds() ? cloud_lidar_json(figures, i) : lidar_json(figures, i);
  if (const auto turn = turn_of_lidars(config.motion_sources, figures.sweeps.compared))
    for (const LidarOptions& lidar : config.lidars)
      json["lidars"][lidar.name]["learned"] = learned_json(lidar, *turn);
  if (const std::string warning = lidar_mounting_warning(figures); !warning.empty())
    json["mounting_warning"] = warning;
  json["sweeps"] = {{"seen", counters.seen},
                    {"processed", counters.processed},
                    {"dropped", counters.dropped},
                    {"failed", counters.failed},
                    {"dead_reckoned", figures.sweeps.dead_reckoned},
                    {"without_source", figures.sweeps.without_source}};
  json["trajectory_digest"] = figures.sweeps.trajectory_digest;
  json.update(sweeps_json(figures.sweeps));
  json["sources"] = ordered_json::object();
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i)
    json["sources"][config.motion_sources[i].name] = source_json(figures, i);
  if (figures.live)
    json.update(live_json(figures, *figures.live));
  return json;
}

} // namespace locus::daemon
