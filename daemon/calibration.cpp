// SPDX-License-Identifier: Apache-2.0
#include "daemon/calibration.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <string_view>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "core/base/pose.hpp"
#include "core/sources/motion_track.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

constexpr double kMinDeviation_sigma = 3.0;     ///< least deviation from the configuration
constexpr double kObservedRatio = 0.7;          ///< largest ratio of learned to configured sigma of an observed figure
constexpr double kMaxResidualLateness_s = 1e-3; ///< largest delay left after the compensation by MotionTrack
constexpr double kGrossLateness_s = 0.03, kGrossMounting_rad = 3.0 * kRadPerDeg;
constexpr double kSignificance_sigma = 5.0; ///< least significance above these limits
/// Largest sigma of a reported mounting; hard driving biases less certain ones.
constexpr double kMaxMountingSigma_rad = 0.01;
constexpr std::array<std::string_view, 3> kAxisNames{"x (roll)", "y (pitch)", "z (yaw)"};

bool significantly_exceeds(const Learned& figure, double limit) {
  return std::abs(figure.mean) - kSignificance_sigma * figure.sigma > limit;
}

/// Formats a figure and its configuration in `unit`, offset by `from`.
ordered_json figure_json(const Learned& figure, const Learned& configured, double unit, double from = 0.0) {
  return {{"value", rounded(from + figure.mean / unit)},
          {"sd", rounded(figure.sigma / unit)},
          {"configured", rounded(from + configured.mean / unit)},
          {"configured_sd", rounded(configured.sigma / unit)}};
}

ordered_json mounting_json(const LearnedSource& learned, const LearnedSource& configured) {
  ordered_json json;
  for (int axis = 0; axis < 3; ++axis) {
    const ordered_json figure = figure_json(learned.mounting_rad(axis), configured.mounting_rad(axis), kRadPerDeg);
    for (const auto& [key, value] : figure.items())
      json[key].push_back(value);
  }
  return json;
}

bool is_known_better(const Learned& figure, const Learned& configured) {
  return std::abs(figure.mean - configured.mean) > kMinDeviation_sigma * figure.sigma &&
         figure.sigma < kObservedRatio * configured.sigma;
}

/// Returns the keys in which two configurations of a source differ, with the values of the second.
ordered_json changes_json(const MotionSourceOptions& before, const MotionSourceOptions& after) {
  const auto rounded_to = [](double value, double parts) { return std::round(value * parts) / parts + 0.0; };
  ordered_json json = ordered_json::object();
  if (after.late_ms != before.late_ms)
    json["late_ms"] = rounded_to(after.late_ms, 10);
  if (after.scale != before.scale)
    json["scale"] = rounded_to(after.scale, 1e4);
  if (after.yaw_scale != before.yaw_scale)
    json["yaw_scale"] = rounded_to(after.yaw_scale, 1e4);
  if (after.T_base_source == before.T_base_source)
    return json;
  const Eigen::Vector3d& p = after.T_base_source.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(after.T_base_source.rotation) / kRadPerDeg;
  json["T_base_source"] = {
      {"xyz_m", {p.x(), p.y(), p.z()}},
      {"rpy_deg", {rounded_to(rpy_deg.x(), 100), rounded_to(rpy_deg.y(), 100), rounded_to(rpy_deg.z(), 100)}}};
  return json;
}

} // namespace

namespace {

/// Tells whether samples arrive after the de-skew of the points that they belong to.
bool is_too_late(const MotionSourceOptions& source, const LearnedSource& learned) {
  const double late_s = learned.lateness_s().mean;
  return source.kind == SourceKind::imu &&
         late_s - to_seconds(MotionTrack::applied_lateness(late_s)) > kMaxResidualLateness_s;
}

} // namespace

ordered_json learned_json(const MotionSourceOptions& source, const LearnedSource& learned, bool in_time) {
  const LearnedSource configured = as_configured(source);
  ordered_json json;
  if (source.kind == SourceKind::imu) {
    json["late_ms"] = figure_json(learned.lateness_s(), configured.lateness_s(), 1e-3);
    json["mounting_deg"] = mounting_json(learned, configured);
  } else {
    json["scale"] = figure_json(learned.scale(), configured.scale(), 1.0, 1.0);
    json["yaw_scale"] = figure_json(learned.yaw_scale(), configured.yaw_scale(), 1.0, 1.0);
  }
  json["since_ns"] = to_ns(learned.since);
  json["too_late"] = !in_time && is_too_late(source, learned);
  json["calibrated"] = json["too_late"] ? ordered_json::object() : changes_json(source, calibrated(source, learned));
  return json;
}

MotionSourceOptions calibrated(const MotionSourceOptions& source, const LearnedSource& learned) {
  const LearnedSource configured = as_configured(source);
  MotionSourceOptions better = source;
  if (source.kind == SourceKind::odometry) {
    if (is_known_better(learned.scale(), configured.scale()))
      better.scale = 1.0 + learned.scale().mean;
    if (is_known_better(learned.yaw_scale(), configured.yaw_scale()))
      better.yaw_scale = 1.0 + learned.yaw_scale().mean;
    return better;
  }
  if (is_known_better(learned.lateness_s(), configured.lateness_s()))
    better.late_ms = 1e3 * learned.lateness_s().mean;
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis)
    if (is_known_better(learned.mounting_rad(axis), configured.mounting_rad(axis)))
      turn_rad[axis] = learned.mounting_rad(axis).mean;
  if (!turn_rad.isZero())
    better.T_base_source.rotation = (so3_exp(turn_rad) * source.T_base_source.rotation).normalized();
  return better;
}

namespace {

/// Formats the configuration entry of a source, with the keys in `better`.
std::string entry_yaml(const std::string& name, const ordered_json& learned, const ordered_json& better) {
  std::string yaml =
      fmt::format("  - name: {}\n    kind: {}\n", name, learned.contains("late_ms") ? "imu" : "odometry");
  for (const char* const key : {"late_ms", "scale", "yaw_scale"})
    if (better.contains(key))
      yaml += fmt::format("    {}: {} # sd {:.3g}\n", key, better[key].get<double>(),
                          learned.at(key).at("sd").get<double>());
  if (better.contains("T_base_source")) {
    const auto& T = better["T_base_source"];
    yaml += fmt::format("    T_base_source: {{xyz_m: [{}], rpy_deg: [{}]}} # sd {:.2g} degrees about x, y, z of base\n",
                        fmt::join(T["xyz_m"].get<std::vector<double>>(), ", "),
                        fmt::join(T["rpy_deg"].get<std::vector<double>>(), ", "),
                        fmt::join(learned.at("mounting_deg").at("sd").get<std::vector<double>>(), ", "));
  }
  return yaml;
}

} // namespace

std::string calibration_yaml(const ordered_json& sources) {
  std::string notes, entries;
  for (const auto& [name, source] : sources.items()) {
    const ordered_json learned = source.value("learned", ordered_json::object());
    if (learned.value("too_late", false))
      notes += fmt::format("# {} arrives too late for a calibration during a drive; calibrate it from a recording:\n"
                           "# locus-replay --calibrate FILE RECORDING\n",
                           name);
    if (const ordered_json better = learned.value("calibrated", ordered_json::object()); !better.empty())
      entries += entry_yaml(name, learned, better);
  }
  return notes + (entries.empty() ? "# No learned value is better known than the configured one.\n"
                                  : "# For the entries of the same name.\nmotion_sources:\n" + entries);
}

namespace {

std::string text_of(double value, double sd) { return fmt::format("{:.4g} +- {:.2g}", value, sd); }

/// Formats a line of the table for the figure `json`, or for one axis of it.
std::string line_of(std::string_view source, std::string_view figure, const ordered_json& json, bool too_late,
                    int axis = -1) {
  const auto get = [&](const char* key) {
    const ordered_json& value = json.at(key);
    return (axis < 0 ? value : value.at(static_cast<std::size_t>(axis))).get<double>();
  };
  const double sd = get("sd"), off = std::abs(get("value") - get("configured"));
  const std::string_view verdict = too_late ? "too late to calibrate during a drive"
                                   : sd >= kObservedRatio * get("configured_sd") ? "not observed by the drives so far"
                                   : off > kMinDeviation_sigma * sd              ? "better known than configured"
                                                                                 : "as configured";
  return fmt::format("{:<12} {:<24} {:>16} {:>20}  {}\n", source, figure,
                     text_of(get("configured"), get("configured_sd")), text_of(get("value"), sd), verdict);
}

} // namespace

std::string calibration_text(const ordered_json& sources) {
  std::string text = fmt::format("{:<12} {:<24} {:>16} {:>20}\n", "source", "figure", "configured", "learned");
  const std::size_t head = text.size();
  for (const auto& [name, source] : sources.items()) {
    if (!source.contains("learned"))
      continue;
    const ordered_json& learned = source["learned"];
    const bool too_late = learned.value("too_late", false);
    for (const auto& [figure, json] : learned.items()) {
      if (figure == "mounting_deg")
        for (int axis = 0; axis < 3; ++axis)
          text += line_of(name, fmt::format("mounting_deg {}", kAxisNames[static_cast<std::size_t>(axis)]), json,
                          too_late, axis);
      else if (json.is_object() && json.contains("configured_sd"))
        text += line_of(name, figure, json, too_late);
    }
    const auto since_s = static_cast<std::time_t>(learned.value("since_ns", std::int64_t{0}) / 1'000'000'000);
    text += fmt::format("{:<12} since {:%F %T}\n", "", fmt::localtime(since_s));
  }
  return text.size() > head ? text : "No motion source that calibrates itself has been received.\n";
}

std::string calibration_warning(const Figures& figures, std::size_t source) {
  if (figures.config.motion_sources[source].kind != SourceKind::imu || !figures.sweeps.last ||
      !figures.sweeps.last->sources[source].learned)
    return "";
  const LearnedSource& learned = *figures.sweeps.last->sources[source].learned;
  const bool too_late = is_too_late(figures.config.motion_sources[source], learned);
  const double configured_ms = figures.config.motion_sources[source].late_ms;
  Learned late = learned.lateness_s();
  late.mean -= 1e-3 * configured_ms;
  if (significantly_exceeds(late, kGrossLateness_s))
    return fmt::format("stamps a motion {} {} lidar does{}; make its driver stamp samples when they are measured and "
                       "check the clocks of both, or {}",
                       too_late ? fmt::format("more than {:.0f} ms", 1e3 * kGrossLateness_s)
                                : fmt::format("{:.0f} ms", std::abs(1e3 * late.mean)),
                       late.mean > 0.0 ? "later than" : "earlier than",
                       configured_ms != 0.0 ? " on top of late_ms" : "",
                       too_late ? "estimate late_ms from a recording, with locus-replay --calibrate"
                                : fmt::format("configure late_ms: {:.0f}", configured_ms + 1e3 * late.mean));
  for (int axis = 0; axis < 3 && !too_late; ++axis) {
    const Learned turn = learned.mounting_rad(axis);
    if (turn.sigma < kMaxMountingSigma_rad && significantly_exceeds(turn, kGrossMounting_rad))
      return fmt::format("is rotated by {:+.1f} degrees about {} of the base relative to lidar, against T_base_source "
                         "and T_base_lidar; measure both, and correct the wrong rpy_deg",
                         turn.mean / kRadPerDeg, kAxisNames[static_cast<std::size_t>(axis)]);
  }
  return "";
}

} // namespace locus::daemon
