// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/report.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "config/config_yaml.hpp"
#include "locus_replay/quantiles.hpp"
#include "locus_replay/report_map.hpp"
#include "locus_replay/report_series.hpp"
#include "pages/data_page.hpp"

// Embedded into the program by locus_page() in CMake.
extern "C" const char locus_report_page_begin[]; // NOLINT(modernize-avoid-c-arrays): set by the linker
extern "C" const char locus_report_page_end[];   // NOLINT(modernize-avoid-c-arrays)

namespace locus::tools {
namespace {

using nlohmann::ordered_json;

/// Converts to seconds since the start of the capture, as in --start and --fail.
class TimeAxis {
 public:
  explicit TimeAxis(const Report& report) : zero_(report.capture_start) {}
  [[nodiscard]] double operator()(Stamp stamp) const { return to_seconds(stamp - zero_); }

 private:
  Stamp zero_;
};

template <class Value>
ordered_json sweep_series(const Report& report, const TimeAxis& time, double resolution, const Value& value) {
  std::vector<Sample> samples;
  for (const SweepRecord& sweep : report.sweeps)
    samples.push_back({time(sweep.stamp), value(sweep)});
  return series(samples, resolution);
}

ordered_json error_series(const TrajectoryAccuracy& accuracy, const TimeAxis& time, double resolution) {
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < accuracy.stamps.size(); ++i)
    samples.push_back({time(accuracy.stamps[i]), accuracy.position_error_m[i]});
  return series(samples, resolution);
}

ordered_json all_series(const Report& report, const TimeAxis& time) {
  constexpr double kTenMicrometres = 1e-5, kMillimetrePerSecond = 1e-3, kMicrosecondInMs = 1e-3;
  ordered_json series;
  if (report.accuracy)
    series["error_m"] = error_series(*report.accuracy, time, kTenMicrometres);
  series["std_m"] = sweep_series(report, time, kTenMicrometres, [](const SweepRecord& sweep) { return sweep.std_m; });
  series["speed_mps"] =
      sweep_series(report, time, kMillimetrePerSecond, [](const SweepRecord& sweep) { return sweep.speed_mps; });
  series["process_ms"] =
      sweep_series(report, time, kMicrosecondInMs, [](const SweepRecord& sweep) { return sweep.wall_ms; });
  return series;
}

ordered_json estimated_path(const Report& report, const TimeAxis& time) {
  std::vector<PathPoint> points;
  for (const SweepRecord& sweep : report.sweeps)
    points.push_back({time(sweep.stamp), sweep.T_odom_base.translation});
  return path(std::move(points));
}

/// Returns the true path during the run, aligned with the estimate as in the comparison.
ordered_json true_path(const Report& report, const TimeAxis& time) {
  const Pose T_odom_truth = report.accuracy->T_truth_odom.inverse();
  std::vector<PathPoint> points;
  for (const StampedPose& pose : report.truth) {
    if (pose.stamp >= report.sweeps.front().stamp && pose.stamp <= report.sweeps.back().stamp)
      points.push_back({time(pose.stamp), T_odom_truth * pose.T_source_base.translation});
  }
  return path(std::move(points));
}

template <class State>
ordered_json sweep_band(const Report& report, const TimeAxis& time, const std::string& name, const State& state) {
  std::vector<BandSample> samples;
  for (const SweepRecord& sweep : report.sweeps)
    samples.push_back({time(sweep.stamp), static_cast<int>(state(sweep))});
  ordered_json band_of_name{{"name", name}};
  band_of_name.update(band(samples));
  return band_of_name;
}

ordered_json health_bands(const Report& report, const TimeAxis& time) {
  ordered_json bands =
      ordered_json::array({sweep_band(report, time, "lidar", [](const SweepRecord& sweep) { return sweep.lidars; })});
  const std::vector<MotionSource>& sources = report.config.motion_sources;
  for (std::size_t i = 0; i < sources.size(); ++i)
    bands.push_back(
        sweep_band(report, time, sources[i].name, [i](const SweepRecord& sweep) { return sweep.sources.at(i); }));
  return bands;
}

/// Maps states to the order of bands: the worse, the smaller.
ordered_json state_band(const Report& report, const TimeAxis& time) {
  return sweep_band(report, time, "state", [](const SweepRecord& sweep) {
    switch (sweep.state) {
    case TrackingState::dead_reckoning:
      return 0;
    case TrackingState::degenerate:
      return 1;
    case TrackingState::standstill:
      return 2;
    case TrackingState::tracking:
      break;
    }
    return 3;
  });
}

ordered_json box_of(const std::string& name, std::span<const double> errors_m) {
  const Quantiles quantiles({errors_m.begin(), errors_m.end()});
  return {{"name", name},
          {"p1", quantiles.at(0.01)},
          {"q1", quantiles.at(0.25)},
          {"median", quantiles.at(0.5)},
          {"q3", quantiles.at(0.75)},
          {"p99", quantiles.at(0.99)},
          {"max", quantiles.at(1.0)},
          {"mean", statistics_of(errors_m).mean}};
}

/// Returns the errors of the whole run, and of each fifth of it to show whether they grow.
ordered_json error_boxes(const TrajectoryAccuracy& accuracy) {
  constexpr std::size_t kParts = 5;
  const std::span<const double> errors_m{accuracy.position_error_m};
  ordered_json boxes = ordered_json::array({box_of("whole run", errors_m)});
  for (std::size_t part = 0; errors_m.size() >= kParts && part < kParts; ++part) {
    const std::size_t begin = part * errors_m.size() / kParts, end = (part + 1) * errors_m.size() / kParts;
    boxes.push_back(
        box_of(std::to_string(part + 1) + "/" + std::to_string(kParts), errors_m.subspan(begin, end - begin)));
  }
  return boxes;
}

/// Returns the CPU time of each stage, by its name in the summary.
ordered_json stage_quantiles(const Report& report) {
  ordered_json stages;
  for (std::size_t stage = 0; const auto& [name, mean_ms] : report.summary.at("stage_ms").items()) {
    std::vector<double> took_ms;
    for (const SweepRecord& sweep : report.sweeps)
      took_ms.push_back(1e3 * to_seconds(sweep.stages_took.at(stage)));
    const Quantiles quantiles(std::move(took_ms));
    stages[name] = {{"mean", mean_ms},
                    {"p50", quantiles.at(0.5)},
                    {"p90", quantiles.at(0.9)},
                    {"p99", quantiles.at(0.99)},
                    {"max", quantiles.at(1.0)}};
    ++stage;
  }
  return stages;
}

/// Returns the positions of the first lidar during mapping, at most a few hundred.
std::vector<Eigen::Vector3f> viewpoints(const Report& report) {
  constexpr std::size_t kViewpoints = 200;
  const Eigen::Vector3d lidar_base_m = report.config.lidars.front().T_base_lidar.translation;
  const std::size_t step = report.sweeps.size() / kViewpoints + 1;
  std::vector<Eigen::Vector3f> seen_from;
  for (std::size_t i = 0; i < report.sweeps.size(); i += step)
    seen_from.emplace_back((report.sweeps[i].T_odom_base * lidar_base_m).cast<float>());
  return seen_from;
}

double median_period_s(std::span<const SweepRecord> sweeps) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < sweeps.size(); ++i)
    periods_s.push_back(to_seconds(sweeps[i].stamp - sweeps[i - 1].stamp));
  return Quantiles(std::move(periods_s)).at(0.5);
}

ordered_json figures(const Report& report) {
  const TimeAxis time(report);
  ordered_json run{{"begin_unix_s", to_seconds(report.sweeps.front().stamp.time_since_epoch())},
                   {"period_s", median_period_s(report.sweeps)},
                   {"path_m", report.path_m},
                   {"path", estimated_path(report, time)},
                   {"series", all_series(report, time)},
                   {"state", state_band(report, time)},
                   {"health", health_bands(report, time)},
                   {"stages", stage_quantiles(report)},
                   {"map", map_tiles(report.map, viewpoints(report))}};
  if (report.accuracy) {
    run["truth"] = true_path(report, time);
    const ErrorStatistics& ape_m = report.accuracy->ape_m;
    run["ape_m"] = {
        {"max", ape_m.max}, {"mean", ape_m.mean}, {"rmse", ape_m.rmse}}; // the summary rounds to millimetres
    run["error_boxes"] = error_boxes(*report.accuracy);
  }
  return run;
}

} // namespace

void write_report(const std::filesystem::path& path, const Report& report) {
  ordered_json run{{"summary", report.summary}, {"config", print_config(report.config)}};
  if (!report.sweeps.empty())
    run.update(figures(report));
  write_data_page(path, {locus_report_page_begin, locus_report_page_end}, run);
}

} // namespace locus::tools
