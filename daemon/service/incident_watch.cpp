// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/incident_watch.hpp"

#include <array>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

std::uint64_t contradictions(const IngestReport& ingest) {
  std::uint64_t count = 0;
  for (const IngestReport::Source& source : ingest.sources)
    count +=
        source.counters.rejected_as(HealthReason::disagreement) + source.counters.rejected_as(HealthReason::self_check);
  return count;
}

ordered_json host_json() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  std::array<double, 3> load{};
  getloadavg(load.data(), static_cast<int>(load.size()));
  return {{"name", name.data()}, {"load", load}, {"processors", sysconf(_SC_NPROCESSORS_ONLN)}};
}

ordered_json head_of_report(IncidentCause cause, Stamp when) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(when.time_since_epoch()).count();
  return {{"why", to_string(cause)},
          {"when", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(seconds)))},
          {"t_ns", to_ns(when)},
          {"version", LOCUS_VERSION},
          {"host", host_json()}};
}

std::string text_of(const ordered_json& json) {
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + '\n';
}

} // namespace

std::optional<IncidentCause> IncidentWatch::check(const Figures& figures) {
  const std::uint64_t before = std::exchange(contradictions_, contradictions(figures.ingest));
  const std::optional<OdometryEstimate>& last = figures.sweeps.last;
  const Duration now = clock_(CLOCK_MONOTONIC);
  if (!last || last->state != TrackingState::dead_reckoning) {
    has_tracked_ = last.has_value();
    lost_since_.reset();
  } else if (has_tracked_) {
    lost_since_ = lost_since_.value_or(now);
    if (now - *lost_since_ >= kMinLoss) {
      has_tracked_ = false;
      return IncidentCause::tracking_lost;
    }
  }
  if (contradictions_ <= before)
    return std::nullopt;
  const std::optional<Duration> earlier = std::exchange(contradicted_, now);
  return earlier && now - *earlier < kMinGap ? std::nullopt : std::optional{IncidentCause::contradiction};
}

std::string incident_report(IncidentCause cause, Stamp when, const Figures& figures) {
  ordered_json json = head_of_report(cause, when);
  json["status"] = to_json(figures);
  return text_of(json);
}

std::string restart_report(Stamp when, const std::filesystem::path& run, const std::optional<Pose>& T_odom_base) {
  ordered_json json = head_of_report(IncidentCause::restart, when);
  json["run"] = run.filename().string();
  if (T_odom_base) {
    const Eigen::Vector3d& p = T_odom_base->translation;
    const Eigen::Vector3d rpy_deg = to_rpy_rad(T_odom_base->rotation) / kRadPerDeg;
    json["pose"] = {{"xyz_m", {p.x(), p.y(), p.z()}}, {"rpy_deg", {rpy_deg.x(), rpy_deg.y(), rpy_deg.z()}}};
  }
  return text_of(json);
}

} // namespace locus::daemon
