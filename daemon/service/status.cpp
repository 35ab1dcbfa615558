// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/status.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <string>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "core/base/pose.hpp"
#include "daemon/figures_json.hpp"
#include "daemon/machine_time.hpp"
#include "drivers/net/ip_address.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

constexpr std::array<std::string_view, 4> kPpsNames{"absent", "synchronizing", "locked", "error"};

/// Estimates older than this say nothing about now.
constexpr Duration kStale = std::chrono::seconds{2};

/// Milliseconds since then; null for never.
ordered_json ms_since(Stamp then) {
  if (then == Stamp{})
    return nullptr;
  return rounded(1e3 * to_seconds(Stamp{read_clock(CLOCK_REALTIME)} - then));
}

/// What its packets tell is wrong with a lidar, though it may be heard; empty if nothing is.
std::string problem_of(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  return shared_port(options, lidar).value_or(unknown_model(options, lidar).value_or(""));
}

ordered_json lidar_json(const LidarOptions& options, const IngestReport::Lidar& lidar) {
  const auto address_or_null = [](const std::optional<std::uint32_t>& ip) {
    return ip ? ordered_json(dotted(*ip)) : ordered_json(nullptr);
  };
  ordered_json json{{"port", options.port},
                    {"source_ip", address_or_null(lidar.source_ip)},
                    {"refused_ip", address_or_null(lidar.refused_ip)}};
  json.update(model_json(lidar));
  json["heard_ms_ago"] = ms_since(lidar.last_heard);
  json["pps"] = kPpsNames[static_cast<std::size_t>(lidar.pps) % kPpsNames.size()];
  json["problem"] = problem_of(options, lidar);
  return json;
}

/// "a.b.c": "1" of everything below `json`, as diagnostics have it.
void flatten(const ordered_json& json, const std::string& prefix,
             std::vector<std::pair<std::string, std::string>>& out) {
  for (const auto& [key, value] : json.items()) {
    if (value.is_object())
      flatten(value, prefix + key + '.', out);
    else
      out.emplace_back(prefix + key, value.is_string() ? value.get<std::string>() : value.dump());
  }
}

Diagnostic with_values(Diagnostic::Level level, const std::string& name, const std::string& message,
                       const ordered_json& json) {
  Diagnostic diagnostic{level, "locusd" + name, message, {}};
  flatten(json, "", diagnostic.values);
  return diagnostic;
}

ordered_json subset(const ordered_json& json, std::initializer_list<const char*> keys) {
  ordered_json part;
  for (const char* key : keys)
    part[key] = json[key];
  return part;
}

ordered_json packets_json(const Config& config, const IngestReport& ingest) {
  ordered_json packets{{"total", to_json(ingest.total)}};
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    packets[config.lidars[i].name] = to_json(ingest.lidars[i].packets);
  return packets;
}

ordered_json sources_json(const Config& config, const LiveFigures::Snapshot& figures, const RosLink::Status& link) {
  ordered_json sources = ordered_json::object();
  for (std::size_t i = 0; i < config.motion_sources.size(); ++i) {
    const IngestReport::Source& source = figures.ingest.sources[i];
    ordered_json json = to_json(source.counters, figures.sums.used_sweeps[i]);
    json["health"] = source.healthy ? "healthy" : source.counters.received == 0 ? "never heard" : "lost";
    json["heard_ms_ago"] = ms_since(source.last_heard);
    json["verdict"] = source.verdict;
    json["writers"] = link.sources[i].writers;
    json["refused"] = link.sources[i].refused;
    json["health_refused"] = link.sources[i].health_refused;
    sources[config.motion_sources[i].name] = json;
  }
  return sources;
}

void add_estimate(const LiveFigures::Snapshot& figures, ordered_json& json) {
  json["rate_hz"] = rounded(figures.rate_hz);
  if (!figures.last) {
    json["state"] = "waiting";
    return;
  }
  const OdometryEstimate& last = *figures.last;
  const Eigen::Vector3d& p = last.T_odom_base.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(last.T_odom_base.rotation) / kRadPerDeg;
  json["state"] = to_string(last.state);
  json["age_ms"] = ms_since(last.stamp);
  json["t_ns"] = to_ns(last.stamp);
  json["pose"] = {{"xyz_m", {p.x(), p.y(), p.z()}}, {"rpy_deg", {rpy_deg.x(), rpy_deg.y(), rpy_deg.z()}}};
  std::vector<double> covariance;
  covariance.reserve(36);
  for (int i = 0; i < 36; ++i)
    covariance.push_back(last.pose_covariance(i / 6, i % 6));
  json["covariance"] = covariance;
  json["observability"] = std::vector<double>(last.observability.begin(), last.observability.end());
}

} // namespace

ordered_json status_json(Session& session) {
  const Config& config = session.config();
  const LiveFigures::Snapshot figures = session.figures().snapshot();
  const RosLink::Status link = session.link().status();
  const std::optional<Recorder::Status> recording = session.recording();
  ordered_json json{{"version", LOCUS_VERSION},
                    {"capture", recording ? recording->run.string() : ""},
                    {"config_sha256", config_sha256(config)},
                    {"threads", config.odometry.threads},
                    {"isa", std::string(to_string(config.odometry.isa))},
                    {"duration_s", rounded(to_seconds(session.age()))},
                    {"wall_s", rounded(to_seconds(session.age()))},
                    {"cpu_s", rounded(to_seconds(session.cpu()))},
                    {"peak_rss_mb", rounded(peak_rss_mb())}};
  add_estimate(figures, json);
  json["packets"] = packets_json(config, figures.ingest);
  json["packets"]["kernel_drops"] = session.input().kernel_drops();
  json["sweeps"] = to_json(session.pipeline().counters());
  json["process_ms"] = to_json(figures.process_ms);
  json["process_cpu_ms"] = to_json(figures.process_cpu_ms);
  json["stage_ms"] = stages_json(figures.stages, figures.sums.sweeps);
  json["points"] = points_json(figures.sums);
  json["iterations_mean"] = iterations_json(figures.sums);
  json["sources"] = sources_json(config, figures, link);
  for (std::size_t i = 0; i < config.lidars.size(); ++i)
    json["lidars"][config.lidars[i].name] = lidar_json(config.lidars[i], figures.ingest.lidars[i]);
  json["flat_ground"] = session.flat_ground() == FlatGround::on    ? "on"
                        : session.flat_ground() == FlatGround::off ? "off"
                                                                   : "auto";
  const SweepBuilder::Counters& builder = figures.ingest.sweeps;
  json["dropped"] = {{"late_packets", builder.late_packets},
                     {"overflowed_points", builder.overflowed_points},
                     {"motion_samples", session.input().motion_drops()},
                     {"flood_datagrams", session.input().filtered()},
                     {"flat_ground_messages", link.flat_ground_refused},
                     {"estimates_unfetched", session.pipeline().unfetched()},
                     {"estimates_unpublished", figures.unpublished}};
  json["restarts"] = builder.restarts;
  if (recording)
    json["recording"] = {
        {"run", recording->run.string()},  {"mb", rounded(1e-6 * static_cast<double>(recording->bytes))},
        {"recorded", recording->recorded}, {"dropped", recording->dropped},
        {"unfit", recording->unfit},       {"problem", recording->problem}};
  json["dds"] = {{"connected", link.connected},
                 {"domain", config.dds.domain},
                 {"interface", config.dds.interface},
                 {"attempts", link.attempts},
                 {"problem", link.connected ? "" : link.problem}};
  return json;
}

std::vector<Diagnostic> diagnostics(Session& session) {
  using Level = Diagnostic::Level;
  const ordered_json json = status_json(session);
  const std::string state = json["state"];
  const bool fresh = json.contains("age_ms") && json["age_ms"].get<double>() < 1e3 * to_seconds(kStale);
  std::vector<Diagnostic> all;
  all.push_back(
      with_values(!fresh                                         ? Level::stale
                  : state == "tracking" || state == "standstill" ? Level::ok
                                                                 : Level::warning,
                  "", fresh ? state : "no lidar data; look whether the lidars send",
                  subset(json, {"rate_hz", "sweeps", "process_ms", "process_cpu_ms", "stage_ms", "points",
                                "iterations_mean", "dropped", "restarts", "flat_ground", "cpu_s", "peak_rss_mb"})));
  all.push_back(with_values(Level::ok, ": dds", "connected", json["dds"]));
  if (json.contains("recording")) {
    const std::string problem = json["recording"]["problem"];
    all.push_back(with_values(problem.empty() ? Level::ok : Level::warning, ": recording",
                              problem.empty() ? "recording" : problem, json["recording"]));
  }
  for (const auto& [name, lidar] : json["lidars"].items()) {
    ordered_json values = lidar;
    values["packets"] = json["packets"][name];
    const ordered_json& heard_ms_ago = values["heard_ms_ago"];
    const bool heard = values["packets"]["data"].get<std::uint64_t>() > 0 && !heard_ms_ago.is_null();
    const bool silent = heard && heard_ms_ago.get<double>() > 1e3 * to_seconds(kStale);
    const std::string problem = values["problem"];
    all.push_back(with_values(!heard             ? Level::error
                              : silent           ? Level::stale
                              : !problem.empty() ? Level::warning
                                                 : Level::ok,
                              ": lidar " + name,
                              !problem.empty() ? problem
                              : !heard         ? "never heard; look at its cable, address and port"
                              : silent         ? "silent; look at its cable and power"
                                               : "heard",
                              values));
  }
  for (const auto& [name, source] : json["sources"].items()) {
    const std::string health = source["health"];
    all.push_back(with_values(health == "healthy" ? Level::ok : Level::warning, ": source " + name, health, source));
  }
  return all;
}

std::string status_line(Session& session) {
  const LiveFigures::Snapshot figures = session.figures().snapshot();
  if (!figures.last || read_clock(CLOCK_MONOTONIC) - figures.last_at > kStale)
    return figures.ingest.total.received == 0 ? "Waiting for the first lidar packet" : "Waiting for lidar data";
  const SweepCounters sweeps = session.pipeline().counters();
  return fmt::format("{}, {:.1f} Hz, {:.1f} ms a sweep, {} dropped", to_string(figures.last->state), figures.rate_hz,
                     figures.process_ms.p50, sweeps.dropped);
}

} // namespace locus::daemon
