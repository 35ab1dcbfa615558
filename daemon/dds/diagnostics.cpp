// SPDX-License-Identifier: Apache-2.0
#include "daemon/dds/diagnostics.hpp"

#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "daemon/calibration.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

using Level = Diagnostic::Level;

/// Flattens `json` to pairs such as "a.b.c": "1" for diagnostics.
void flatten(const ordered_json& json, const std::string& prefix,
             std::vector<std::pair<std::string, std::string>>& out) {
  for (const auto& [key, value] : json.items()) {
    if (value.is_object())
      flatten(value, prefix + key + '.', out);
    else
      out.emplace_back(prefix + key, value.is_string() ? value.get<std::string>() : value.dump());
  }
}

Diagnostic diagnostic(Level level, const std::string& name, const std::string& message, const ordered_json& values) {
  Diagnostic diagnostic{level, "locusd" + name, message, {}};
  flatten(values, "", diagnostic.values);
  return diagnostic;
}

Diagnostic odometry_diagnostic(const Figures& figures, const ordered_json& json, Stamp now) {
  ordered_json values;
  for (const char* key : {"rate_hz", "sweeps", "process_ms", "process_cpu_ms", "stage_ms", "points", "iterations_mean",
                          "dropped", "restarts", "flat_ground", "cpu_s", "peak_rss_mb"}) {
    if (json.contains(key))
      values[key] = json[key];
  }
  const std::optional<OdometryEstimate>& last = figures.sweeps.last;
  if (!last || now - last->stamp >= kStale)
    return diagnostic(Level::stale, "", "no lidar data; check that the lidars send", values);
  const bool is_well = last->state == TrackingState::tracking || last->state == TrackingState::standstill;
  return diagnostic(is_well ? Level::ok : Level::warning, "", std::string{to_string(last->state)}, values);
}

/// `mounting`: warning of an error in the mounting of all lidars, or empty.
Diagnostic lidar_diagnostic(const LidarOptions& options, const IngestReport::Lidar& lidar, const ordered_json& values,
                            const std::string& mounting, Stamp now) {
  const std::optional<Duration> silence = lidar.used() > 0 ? std::optional(now - lidar.last_received) : std::nullopt;
  const bool is_silent = silence && *silence > kStale;
  const std::string fault = problem_of(options, lidar);
  const std::string& problem = fault.empty() ? mounting : fault;
  return diagnostic(!silence           ? Level::error
                    : is_silent        ? Level::stale
                    : !problem.empty() ? Level::warning
                                       : Level::ok,
                    ": lidar " + options.name,
                    !problem.empty() ? problem
                    : !silence  ? (options.gives_clouds() ? "never heard; check that its driver publishes the topic"
                                                          : "never heard; check its cable, address and port")
                    : is_silent ? "silent; check its cable and power"
                                : "receiving",
                    values);
}

} // namespace

/// Takes the values from the JSON: all of each lidar, source, DDS and recording; otherwise those listed in
/// odometry_diagnostic().
std::vector<Diagnostic> diagnostics(const Figures& figures, Stamp now) {
  const ordered_json json = to_json(figures);
  std::vector<Diagnostic> all{odometry_diagnostic(figures, json, now)};
  if (figures.live)
    all.push_back(diagnostic(Level::ok, ": dds", "connected", json["dds"]));
  if (const auto& recording = figures.live ? figures.live->recording : std::nullopt) {
    const bool is_well = recording->problem.empty();
    all.push_back(diagnostic(is_well ? Level::ok : Level::warning, ": recording",
                             is_well ? "recording" : recording->problem, json["recording"]));
  }
  for (std::size_t i = 0; i < figures.config.lidars.size(); ++i) {
    const LidarOptions& options = figures.config.lidars[i];
    ordered_json values = json["lidars"][options.name];
    if (!options.gives_clouds())
      values["packets"] = json["packets"][options.name];
    all.push_back(lidar_diagnostic(options, figures.ingest.lidars[i], values, lidar_mounting_warning(figures), now));
  }
  for (std::size_t i = 0; i < figures.config.motion_sources.size(); ++i) {
    const std::string& name = figures.config.motion_sources[i].name;
    const IngestReport::Source& source = figures.ingest.sources[i];
    std::string fault = source.healthy && !source.slow_period ? "" : verdict_on(source, figures.live.has_value());
    if (source.healthy || source.gyro_axes)
      fault += (fault.empty() ? "" : "; ") + calibration_warning(figures, i);
    all.push_back(diagnostic(source.healthy && fault.empty() ? Level::ok : Level::warning, ": source " + name,
                             fault.empty() ? std::string{health_of(source)} : fault, json["sources"][name]));
  }
  return all;
}

} // namespace locus::daemon
