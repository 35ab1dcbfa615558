// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <span>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "drivers/net/datagram.hpp"

namespace locus::daemon {

namespace {

/// Number of data packets per foreign packet above which foreign packets are ignored.
constexpr std::uint64_t kNegligibleRatio = 100;

} // namespace

IngestReport::Lidar IngestReport::Lidar::of(const LidarInput& lidar) {
  return {.packets = lidar.counters(),
          .model = lidar.model(),
          .return_mode = lidar.return_mode(),
          .rotation_rate_rpm = lidar.decoder().rotation_rate_rpm(),
          .source_ip = lidar.sender().ip(),
          .refused_ip = lidar.sender().rejected_ip(),
          .other_senders = lidar.sender().others(),
          .unknown_packets = lidar.decoder().unknown_packets(),
          .last_received = lidar.sender().last_received(),
          .unknown_last_received = lidar.unknown_last_received(),
          .pps = lidar.clock_state(),
          .pps_unused = lidar.why_pps_is_unused(),
          .has_date = lidar.decoder().has_date(),
          .packets_of_other_mode = lidar.decoder().ouster() != nullptr && lidar.decoder().ouster()->is_in_other_mode()
                                       ? lidar.decoder().ouster()->packets_of_other_start()
                                       : 0};
}

void IngestReport::Lidar::add(const CloudDecoder& decoder) {
  clouds = Clouds{.counters = decoder.counters(),
                  .doubts = decoder.doubts(),
                  .last_doubted = decoder.last_doubted(),
                  .timing = decoder.timing(),
                  .rings = decoder.rings(),
                  .period = decoder.period()};
  last_received = decoder.last_received();
}

void IngestReport::read(const Ingest& ingest) {
  total = ingest.lidars().total();
  for (std::size_t i = 0; i < ingest.lidars().lidars().size(); ++i) {
    lidars[i] = Lidar::of(ingest.lidars().lidars()[i]);
    if (const CloudDecoder* clouds = ingest.clouds_of(i))
      lidars[i].add(*clouds);
  }
  for (std::size_t i = 0; i < ingest.sources().size(); ++i) {
    const HealthMonitor& health = ingest.sources().health(SourceId{i});
    sources[i] = {.counters = health.counters(),
                  .healthy = health.healthy(),
                  .last_received = health.last_received(),
                  .verdict = health.verdict(),
                  .slow_period = health.is_too_slow() ? health.period() : std::nullopt,
                  .refusal = health.refusal().value_or(Refusal{}),
                  .longest_refusal = health.longest_refusal(),
                  .gyro_axes = health.gyro_axes()};
  }
  sweeps = ingest.sweeps().counters();
}

std::optional<std::string> shared_port(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (options.source_ip || !lidar.source_ip)
    return std::nullopt;
  std::vector<std::string> refused;
  std::string yaml =
      fmt::format("{{name: {}, port: {}, source_ip: {}}}", options.name, options.port, dotted(*lidar.source_ip));
  for (const OtherSender& sender : lidar.other_senders) {
    if (sender.ip == *lidar.source_ip || sender.packets * kNegligibleRatio <= lidar.packets.data)
      continue;
    refused.push_back(fmt::format("{} from {}", sender.packets, dotted(sender.ip)));
    yaml += fmt::format(", {{name: {}_{}, port: {}, source_ip: {}}}", options.name, refused.size() + 1, options.port,
                        dotted(sender.ip));
  }
  if (refused.empty())
    return std::nullopt;
  return fmt::format("lidar {}: other senders use its port {}: packets from {} are used, and {} are rejected; if these "
                     "are lidars, give each its own entry, with its T_base_lidar: lidars: [{}]",
                     options.name, options.port, dotted(*lidar.source_ip), fmt::join(refused, ", "), yaml);
}

std::optional<std::string> unknown_model(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (!lidar.unknown_packets || lidar.unknown_packets->packets * kNegligibleRatio <= lidar.packets.data)
    return std::nullopt;
  if (lidar.unknown_packets->is_readable)
    return fmt::format(
        "lidar {0}: rejected {1}, which is not what lidars.{0} is configured as; set its model to auto, and "
        "calibration, if any, to the file of that sensor",
        options.name, to_string(*lidar.unknown_packets));
  const std::string_view help = remedy(*lidar.unknown_packets);
  return fmt::format(
      "lidar {0}: rejected {1}, no model that can be read{3}{4}; if another device sends to port {2}, set "
      "lidars.{0}.source_ip to that of the lidar",
      options.name, to_string(*lidar.unknown_packets), options.port, help.empty() ? "" : "; ", help);
}

std::vector<std::string> cloud_doubts(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; lidar.clouds && i < kCloudDoubts; ++i) {
    if (lidar.clouds->doubts[i])
      lines.push_back(
          fmt::format("lidar {}: {}", options.name, explain(static_cast<CloudDoubt>(i), lidar.clouds->timing)));
  }
  return lines;
}

std::optional<std::string> stale_metadata(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (lidar.packets_of_other_mode == 0)
    return std::nullopt;
  return fmt::format("lidar {}: rejected the last {} packets: the sensor was restarted after {} was fetched, and runs "
                     "in another mode; fetch it again: locusctl fetch {} -o {}",
                     options.name, lidar.packets_of_other_mode, options.metadata,
                     lidar.source_ip ? dotted(*lidar.source_ip) : "SENSOR", options.metadata);
}

std::optional<std::string> too_fast(const MotionLimits& limits, double largest_speed_mps) {
  constexpr double kTolerance = 1.05;
  if (largest_speed_mps <= kTolerance * limits.max_speed_mps)
    return std::nullopt;
  return fmt::format("estimates reach {:.1f} m/s, above motion.max_speed_mps of {:g}: set it to the top speed of the "
                     "robot, or do not rely on them",
                     largest_speed_mps, limits.max_speed_mps);
}

std::optional<std::string> unused_pps(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  if (lidar.pps_unused.empty())
    return std::nullopt;
  return fmt::format("lidar {}: its PPS is locked, but its time is not used: {}", options.name, lidar.pps_unused);
}

std::optional<std::string> short_sweep(const SweepOptions& options, const std::string& lidar,
                                       double rotation_rate_rpm) {
  constexpr double kTolerance = 0.95, kMsPerMinute = 60e3;
  if (!options.sweep_period || rotation_rate_rpm <= 0.0)
    return std::nullopt;
  const double turn_ms = kMsPerMinute / rotation_rate_rpm, sweep_ms = 1e3 * to_seconds(*options.sweep_period);
  if (sweep_ms >= kTolerance * turn_ms)
    return std::nullopt;
  return fmt::format(
      "lidar {}: one revolution takes {:.0f} ms, so each sweep of {:.0f} ms covers only a different part of the scene; "
      "set sweep_period_ms: auto",
      lidar, turn_ms, sweep_ms);
}

void LatencyHistogram::add(double duration_s) {
  const auto bound = std::ranges::lower_bound(kBounds_s, duration_s);
  ++counts[static_cast<std::size_t>(bound - kBounds_s.begin())];
  sum_s += duration_s;
}

void SweepStatistics::add(const ProcessedSweep& sweep) {
  const OdometryEstimate& estimate = sweep.estimate;
  const Timing timing{read_clock(CLOCK_MONOTONIC), static_cast<float>(1e3 * to_seconds(sweep.took.wall)),
                      static_cast<float>(1e3 * to_seconds(sweep.took.cpu))};
  if (timings_.size() < window_)
    timings_.push_back(timing);
  else
    timings_[sums_.sweeps % window_] = timing;
  ++sums_.sweeps;
  sums_.process.add(to_seconds(sweep.took.wall));
  sums_.raw_points += static_cast<double>(sweep.raw_returns);
  sums_.filtered_points += static_cast<double>(estimate.points);
  sums_.scan_to_scan_iterations += estimate.scan_to_scan.iterations;
  sums_.scan_to_submap_iterations += estimate.scan_to_submap.iterations;
  const PriorSource& prior = estimate.prior;
  if (prior.rotation)
    ++sums_.used_sweeps[index_of(*prior.rotation)];
  if (prior.translation && prior.translation != prior.rotation)
    ++sums_.used_sweeps[index_of(*prior.translation)];
  if (sums_.sweeps > 1 && !prior.rotation && !prior.translation)
    ++sums_.without_source;
  for (std::size_t i = 0; i < kMaxSources; ++i) {
    sums_.largest_test_ratios[i] = std::max(sums_.largest_test_ratios[i], estimate.sources[i].test_ratio);
    compare(estimate, i, comparisons_[i]);
  }
  if (estimate.state == TrackingState::dead_reckoning)
    ++sums_.dead_reckoned;
  add_to_trajectory(estimate);
  for (std::size_t i = 0; i < kStages; ++i)
    sums_.stages[i] += sweep.stages_took[i];
  if (sums_.last)
    sums_.path_m += (estimate.T_odom_base.translation - sums_.last->T_odom_base.translation).norm();
  sums_.largest_speed_mps = std::max(sums_.largest_speed_mps, estimate.twist_base.head<3>().norm());
  sums_.last = estimate;
  sums_.last_at = timing.at;
}

void SweepStatistics::add_to_trajectory(const OdometryEstimate& estimate) {
  if (sums_.sweeps == 1)
    trajectory_start_ = estimate.stamp;
  const std::int64_t since_start_ns = (estimate.stamp - trajectory_start_).count();
  trajectory_.add(std::as_bytes(std::span(&since_start_ns, 1)));
  trajectory_.add(std::as_bytes(std::span(estimate.T_odom_base.translation.data(), 3)));
  trajectory_.add(std::as_bytes(std::span(estimate.T_odom_base.rotation.coeffs().data(), 4)));
}

SweepFigures SweepStatistics::figures() const {
  constexpr std::size_t kDigits = 16; ///< short enough to compare by eye
  SweepFigures figures = sums_;
  figures.process_ms = percentiles(&Timing::wall_ms);
  figures.process_cpu_ms = percentiles(&Timing::cpu_ms);
  figures.rate_hz = rate_hz();
  for (std::size_t i = 0; i < kMaxSources; ++i)
    if (comparisons_[i])
      figures.compared[i] = comparisons_[i]->findings();
  figures.trajectory_digest = trajectory_.hex().substr(0, kDigits);
  return figures;
}

/// Uses the nearest-rank method: each percentile is one of the values.
Percentiles SweepStatistics::percentiles(float Timing::*figure) const {
  if (timings_.empty())
    return {};
  std::vector<float> values(timings_.size());
  std::ranges::transform(timings_, values.begin(), [figure](const Timing& timing) { return timing.*figure; });
  std::ranges::sort(values);
  const auto at = [&](double share) {
    const double rank = std::max(1.0, std::ceil(share * static_cast<double>(values.size())));
    return static_cast<double>(values[static_cast<std::size_t>(rank) - 1]);
  };
  return {at(0.5), at(0.9), at(0.99), at(1.0)};
}

double SweepStatistics::rate_hz() const {
  constexpr Duration kSpan = std::chrono::seconds{5};
  const Duration now = read_clock(CLOCK_MONOTONIC);
  std::size_t recent = 0;
  Duration oldest = now;
  for (; recent < timings_.size(); ++recent) {
    const Timing& timing = timings_[(sums_.sweeps - 1 - recent) % window_];
    if (now - timing.at > kSpan)
      break;
    oldest = timing.at;
  }
  const double elapsed_s = to_seconds(now - oldest);
  return recent > 1 && elapsed_s > 0 ? static_cast<double>(recent - 1) / elapsed_s : 0.0;
}

std::optional<Duration> time_since(Stamp then) {
  return then == Stamp{} ? std::nullopt : std::optional{Stamp{read_clock(CLOCK_REALTIME)} - then};
}

std::string_view health_of(const IngestReport::Source& source) {
  return source.healthy ? "healthy" : source.counters.received == 0 ? "never heard" : "lost";
}

std::optional<std::string> slow_imu(const IngestReport::Source& source) {
  if (!source.slow_period)
    return std::nullopt;
  return fmt::format("has a rate of {:.0f} Hz, too low to measure the motion within a sweep; let it publish at 100 Hz "
                     "or more",
                     1.0 / to_seconds(*source.slow_period));
}

std::string verdict_on(const IngestReport::Source& source, bool is_live) {
  const Refusal& refusal = is_live ? source.refusal : source.longest_refusal;
  if (!source.verdict.empty() || !refusal.is_worth_reporting())
    return source.verdict.empty() ? slow_imu(source).value_or("") : std::string{source.verdict};
  return fmt::format("is rejected for {:.0f} s: it {}", to_seconds(refusal.lasted), explanation(refusal.reason));
}

/// Ignores foreign senders and cloud faults that were last seen more than kMaxAge before the lidar's last data.
std::string problem_of(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  constexpr Duration kMaxAge = std::chrono::seconds{5};
  IngestReport::Lidar now = lidar;
  if (lidar.clouds) {
    for (std::size_t i = 0; i < kCloudDoubts; ++i)
      if (lidar.last_received - lidar.clouds->last_doubted[i] > kMaxAge)
        now.clouds->doubts.reset(i);
    const std::vector<std::string> doubts = cloud_doubts(options, now);
    return doubts.empty() ? "" : doubts.front();
  }
  for (OtherSender& sender : now.other_senders)
    if (lidar.last_received - sender.last_received > kMaxAge)
      sender = {};
  if (lidar.last_received - lidar.unknown_last_received > kMaxAge)
    now.unknown_packets.reset();
  for (const auto& problem :
       {shared_port(options, now), unknown_model(options, now), stale_metadata(options, now), unused_pps(options, now)})
    if (problem)
      return *problem;
  return "";
}

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

/// Reads VmHWM rather than getrusage(), whose maximum survives exec and may belong to the parent program.
double peak_rss_mb() {
  std::ifstream status{"/proc/self/status"};
  for (std::string word; status >> word;) {
    if (double kib = 0; word == "VmHWM:" && status >> kib)
      return kib * 1024.0 / 1e6;
  }
  return 0.0;
}

} // namespace locus::daemon
