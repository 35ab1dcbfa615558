// SPDX-License-Identifier: Apache-2.0
#include "sample_run.hpp"

#include <cmath>

namespace locus::test {
namespace {

using nlohmann::ordered_json;
using tools::SourceHealth;
using tools::SweepRecord;

constexpr Stamp kBegin = stamp_from_ns(1'700'000'000'000'000'000);
constexpr double kRoundPeriod_s = 300.0;
constexpr double kDrift_mps = 1e-5;

Pose true_pose(double t_s) {
  const double angle = 2.0 * M_PI * t_s / kRoundPeriod_s;
  const double radius_m = 60.0 + 20.0 * std::sin(t_s / 700.0);
  return {from_rpy_rad({0.0, 0.0, angle + M_PI / 2.0}),
          {radius_m * std::cos(angle), radius_m * std::sin(angle), 2.0 + std::sin(2.0 * angle)}};
}

Stamp stamp_at(double t_s) { return kBegin + from_seconds(t_s); }

bool within(double t_s, double begin_s, double end_s) { return t_s >= begin_s && t_s < end_s; }

SweepRecord sweep_at(double t_s) {
  SweepRecord sweep;
  sweep.stamp = stamp_at(t_s);
  sweep.T_odom_base = true_pose(t_s);
  sweep.T_odom_base.translation.x() += kDrift_mps * t_s + 0.002 * std::sin(13.0 * t_s);
  sweep.std_m = 1e-4 * std::sqrt(t_s);
  sweep.speed_mps = 1.3 + 0.1 * std::sin(t_s);
  sweep.wall_ms = 2.0 + std::abs(std::sin(7.0 * t_s));
  for (std::size_t stage = 0; stage < sweep.stages_took.size(); ++stage)
    sweep.stages_took.at(stage) = from_seconds(1e-4 * static_cast<double>(stage + 1) * (1.5 + std::sin(5.0 * t_s)));
  sweep.sources = {SourceHealth::used, SourceHealth::healthy};
  if (within(t_s, 20.0, 24.0)) {
    sweep.state = TrackingState::dead_reckoning;
    sweep.lidars = SourceHealth::lost;
  }
  if (within(t_s, 30.0, 33.0))
    sweep.state = TrackingState::degenerate;
  if (within(t_s, 40.0, 45.0))
    sweep.sources = {SourceHealth::lost, SourceHealth::used};
  return sweep;
}

/// Houses of 20 m along streets of 10 m, with a surface every 0.5 m of their walls.
std::vector<SurfacePoint> town(int blocks_a_side) {
  std::vector<SurfacePoint> map;
  const auto wall = [&](const Eigen::Vector3f& corner, const Eigen::Vector3f& along, const Eigen::Vector3f& normal) {
    for (float a = 0.0F; a < 20.0F; a += 0.5F) {
      for (float z = 0.0F; z < 12.0F; z += 0.5F)
        map.push_back({corner + a * along + z * Eigen::Vector3f::UnitZ(), normal});
    }
  };
  for (int row = 0; row < blocks_a_side; ++row) {
    for (int column = 0; column < blocks_a_side; ++column) {
      const float x = 30.0F * (static_cast<float>(column) - 0.5F * static_cast<float>(blocks_a_side));
      const float y = 30.0F * (static_cast<float>(row) - 0.5F * static_cast<float>(blocks_a_side));
      wall({x, y, 0.0F}, Eigen::Vector3f::UnitX(), -Eigen::Vector3f::UnitY());
      wall({x, y + 20.0F, 0.0F}, Eigen::Vector3f::UnitX(), Eigen::Vector3f::UnitY());
      wall({x, y, 0.0F}, Eigen::Vector3f::UnitY(), -Eigen::Vector3f::UnitX());
      wall({x + 20.0F, y, 0.0F}, Eigen::Vector3f::UnitY(), Eigen::Vector3f::UnitX());
    }
  }
  return map;
}

ordered_json source_summary(int rejected) {
  return {{"received", 1000},
          {"used_sweeps", 900},
          {"rejected",
           {{"stale", 0},
            {"jump", 0},
            {"nan", rejected},
            {"frozen", 0},
            {"out_of_order", 0},
            {"covariance", 0},
            {"disagreement", 0}}},
          {"health_changes", rejected}};
}

/// A summary with the keys of summary.json.
ordered_json summary_of(const std::string& capture, double duration_s, std::size_t sweeps) {
  const ordered_json packets{{"received", 1'000'000},
                             {"data", 900'000},
                             {"position", 99'990},
                             {"lost", 12},
                             {"reordered", 0},
                             {"clock_steps", 0},
                             {"rejected",
                              {{"length", 10},
                               {"flag", 0},
                               {"model", 0},
                               {"sender", 0},
                               {"azimuth", 0},
                               {"time", 0},
                               {"duplicate", 0},
                               {"truncated", 0},
                               {"checksum", 0}}}};
  const ordered_json percentiles{{"p50", 2.1}, {"p90", 2.9}, {"p99", 3.4}, {"max", 8.8}};
  return {{"version", "0.0.0"},
          {"capture", capture},
          {"config_sha256", std::string(64, '0')},
          {"threads", 2},
          {"isa", "avx2"},
          {"duration_s", duration_s},
          {"wall_s", duration_s / 20.0},
          {"cpu_s", duration_s / 15.0},
          {"peak_rss_mb", 150.0},
          {"packets", {{"total", packets}, {"front", packets}, {"rear", packets}}},
          {"lidars", {{"front", {{"model", "VLP-16"}}}, {"rear", {{"model", nullptr}}}}},
          {"sweeps", {{"seen", sweeps + 3}, {"processed", sweeps}, {"dropped", 2}, {"failed", 1}}},
          {"process_ms", percentiles},
          {"process_cpu_ms", percentiles},
          {"stage_ms",
           {{"decode", 0.1},
            {"correct", 0.2},
            {"filter", 0.3},
            {"covariance", 0.4},
            {"scan_to_scan", 0.5},
            {"scan_to_submap", 0.6},
            {"map", 0.7}}},
          {"points", {{"raw_mean", 28'645.4}, {"filtered_mean", 1976.1}}},
          {"iterations_mean", {{"scan_to_scan", 0.0}, {"scan_to_submap", 4.06}}},
          {"sources", ordered_json::object()}};
}

} // namespace

SampleRun SampleRun::of(std::chrono::seconds length, const std::string& capture) {
  SampleRun run;
  run.capture_start = kBegin;
  const double length_s = to_seconds(length);
  for (double t_s = 0.0; t_s < length_s; t_s += 0.1)
    run.sweeps.push_back(sweep_at(t_s));
  for (double t_s = -1.0; t_s < length_s + 1.0; t_s += 0.01)
    run.truth.push_back({stamp_at(t_s), true_pose(t_s)});
  std::vector<StampedPose> estimates;
  for (std::size_t i = 0; i < run.sweeps.size(); ++i) {
    estimates.push_back({run.sweeps[i].stamp, run.sweeps[i].T_odom_base});
    if (i > 0)
      run.path_m += (estimates[i].T_source_base.translation - estimates[i - 1].T_source_base.translation).norm();
  }
  run.accuracy = trajectory_accuracy(estimates, run.truth);
  run.map = town(length < std::chrono::minutes{10} ? 3 : 10);
  run.summary = summary_of(capture, length_s, run.sweeps.size());
  for (std::size_t i = 0; i < run.config.motion_sources.size(); ++i)
    run.summary["sources"][run.config.motion_sources[i].name] = source_summary(i == 0 ? 7 : 0);
  run.summary["rpe_10m_percent"] = 0.04;
  run.summary["end_drift_m"] = 0.036;
  return run;
}

SampleRun SampleRun::bare() {
  SampleRun run;
  run.capture_start = kBegin;
  run.config.motion_sources.clear();
  for (const double t_s : {0.0, 0.1, 0.2})
    run.sweeps.push_back(sweep_at(t_s));
  run.path_m = 0.26;
  run.summary = summary_of("bare.pcap", 0.3, run.sweeps.size());
  return run;
}

} // namespace locus::test
