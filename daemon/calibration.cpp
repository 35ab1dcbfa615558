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
constexpr double kSignificance_sigma = 5.0;              ///< least significance above these limits
constexpr double kGrossLidarTurn_rad = 2.0 * kRadPerDeg; ///< a climb of 35 mm in a metre
constexpr double kSameTurn_rad = 1.5 * kRadPerDeg;       ///< largest difference of two observations of one rotation
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

using Turn = std::array<Learned, 3>; ///< about the axes of the base, rad

Turn mounting_of(const LearnedSource& source) {
  return {source.mounting_rad(0), source.mounting_rad(1), source.mounting_rad(2)};
}

ordered_json turn_json(const Turn& learned, const Turn& configured) {
  ordered_json json;
  for (std::size_t axis = 0; axis < learned.size(); ++axis) {
    const ordered_json figure = figure_json(learned[axis], configured[axis], kRadPerDeg);
    for (const auto& [key, value] : figure.items())
      json[key].push_back(value);
  }
  return json;
}

bool is_observed(const Learned& figure, const Learned& configured) {
  return figure.sigma < kObservedRatio * configured.sigma;
}

bool is_known_better(const Learned& figure, const Learned& configured) {
  return std::abs(figure.mean - configured.mean) > kMinDeviation_sigma * figure.sigma &&
         is_observed(figure, configured);
}

/// Returns the part of a rotation that is known better than configured.
Eigen::Vector3d known_turn_rad(const Turn& learned, const Turn& configured) {
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
  for (std::size_t axis = 0; axis < learned.size(); ++axis)
    if (is_known_better(learned[axis], configured[axis]))
      turn_rad[static_cast<Eigen::Index>(axis)] = learned[axis].mean;
  return turn_rad;
}

double rounded_to(double value, double parts) { return std::round(value * parts) / parts + 0.0; }

} // namespace

ordered_json mounting_json(const Pose& T_base_sensor) {
  const Eigen::Vector3d& p = T_base_sensor.translation;
  const Eigen::Vector3d rpy_deg = to_rpy_rad(T_base_sensor.rotation) / kRadPerDeg;
  return {{"xyz_m", {p.x(), p.y(), p.z()}},
          {"rpy_deg", {rounded_to(rpy_deg.x(), 100), rounded_to(rpy_deg.y(), 100), rounded_to(rpy_deg.z(), 100)}}};
}

namespace {

/// Returns the keys in which two configurations of a source differ, with the values of the second.
ordered_json changes_json(const MotionSourceOptions& before, const MotionSourceOptions& after) {
  ordered_json json = ordered_json::object();
  if (after.late_ms != before.late_ms)
    json["late_ms"] = rounded_to(after.late_ms, 10);
  if (after.scale != before.scale)
    json["scale"] = rounded_to(after.scale, 1e4);
  if (after.yaw_scale != before.yaw_scale)
    json["yaw_scale"] = rounded_to(after.yaw_scale, 1e4);
  if (after.T_base_source != before.T_base_source)
    json["T_base_source"] = mounting_json(after.T_base_source);
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

std::optional<Pose> mounting_with(const MotionSourceOptions& imu, const std::optional<Eigen::Matrix3d>& gyro_axes) {
  if (!gyro_axes || gyro_axes->determinant() < 0.0)
    return std::nullopt;
  return Pose{(Eigen::Quaterniond{*gyro_axes} * imu.T_base_source.rotation).normalized(),
              imu.T_base_source.translation};
}

std::optional<OdometryFindings> findings_on(const Figures& figures, std::size_t source) {
  std::optional<OdometryFindings> found = figures.sweeps.compared[source];
  if (found)
    found->late_s.mean +=
        to_seconds(MotionTrack::applied_lateness(1e-3 * figures.config.motion_sources[source].late_ms));
  return found;
}

namespace {

constexpr Learned kUnknownTurn{0.0, OdometryFindings::kPriorTurn_rad};
constexpr Turn kUnknownTurns{kUnknownTurn, kUnknownTurn, kUnknownTurn};

Learned configured_lateness_s(const MotionSourceOptions& odometry) {
  return {1e-3 * odometry.late_ms, OdometryFindings::kPriorLate_s};
}

/// Returns the configured lateness unless the drive determines it.
Learned lateness_s(const MotionSourceOptions& odometry, const std::optional<OdometryFindings>& compared) {
  const Learned configured = configured_lateness_s(odometry);
  return compared && is_observed(compared->late_s, configured) ? compared->late_s : configured;
}

/// Returns the yaw scale from the estimator or from the comparison with lidar, whichever is more certain: while a gyro
/// works, the estimator does not use the yaw of an odometry.
Learned yaw_scale(const LearnedSource& learned, const std::optional<OdometryFindings>& compared) {
  return compared && compared->yaw_scale.sigma < learned.yaw_scale().sigma ? compared->yaw_scale : learned.yaw_scale();
}

} // namespace

ordered_json learned_json(const MotionSourceOptions& source, const LearnedSource& learned, bool in_time,
                          const std::optional<OdometryFindings>& compared) {
  const LearnedSource configured = as_configured(source);
  ordered_json json;
  if (source.kind == SourceKind::imu) {
    json["late_ms"] = figure_json(learned.lateness_s(), configured.lateness_s(), 1e-3);
    json["mounting_deg"] = turn_json(mounting_of(learned), mounting_of(configured));
  } else {
    json["late_ms"] = figure_json(lateness_s(source, compared), configured_lateness_s(source), 1e-3);
    json["scale"] = figure_json(learned.scale(), configured.scale(), 1.0, 1.0);
    json["yaw_scale"] = figure_json(yaw_scale(learned, compared), configured.yaw_scale(), 1.0, 1.0);
  }
  json["since_ns"] = to_ns(learned.since);
  json["too_late"] = !in_time && is_too_late(source, learned);
  json["calibrated"] =
      json["too_late"] ? ordered_json::object() : changes_json(source, calibrated(source, learned, compared));
  return json;
}

MotionSourceOptions calibrated(const MotionSourceOptions& source, const LearnedSource& learned,
                               const std::optional<OdometryFindings>& compared) {
  const LearnedSource configured = as_configured(source);
  MotionSourceOptions better = source;
  if (source.kind == SourceKind::odometry) {
    if (const Learned late_s = lateness_s(source, compared); is_known_better(late_s, configured_lateness_s(source)))
      better.late_ms = 1e3 * late_s.mean;
    if (is_known_better(learned.scale(), configured.scale()))
      better.scale = 1.0 + learned.scale().mean;
    if (const Learned scale = yaw_scale(learned, compared); is_known_better(scale, configured.yaw_scale()))
      better.yaw_scale = 1.0 + scale.mean;
    return better;
  }
  if (is_known_better(learned.lateness_s(), configured.lateness_s()))
    better.late_ms = 1e3 * learned.lateness_s().mean;
  const Eigen::Vector3d turn_rad = known_turn_rad(mounting_of(learned), mounting_of(configured));
  if (!turn_rad.isZero())
    better.T_base_source.rotation = (so3_exp(turn_rad) * source.T_base_source.rotation).normalized();
  return better;
}

std::optional<LidarTurn> turn_of_lidars(const std::vector<MotionSource>& sources,
                                        const std::array<std::optional<OdometryFindings>, kMaxSources>& compared) {
  std::optional<LidarTurn> best;
  const auto variance = [](const Turn& turn) {
    double sum = 0.0;
    for (const Learned& figure : turn)
      sum += figure.sigma * figure.sigma;
    return sum;
  };
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (compared[i] && sources[i].calibration != Calibration::off &&
        (!best || variance(compared[i]->lidar_turn_rad) < variance(best->rad)))
      best = LidarTurn{i, compared[i]->lidar_turn_rad};
  return best;
}

Eigen::Vector3d known_turn_rad(const LidarTurn& turn) { return known_turn_rad(turn.rad, kUnknownTurns); }

Eigen::Vector3d observed_part(Eigen::Vector3d turn_rad, const MotionSourceOptions& imu, const LearnedSource& learned) {
  const Turn found = mounting_of(learned), configured = mounting_of(as_configured(imu));
  for (std::size_t axis = 0; axis < found.size(); ++axis)
    if (!is_observed(found[axis], configured[axis]))
      turn_rad[static_cast<Eigen::Index>(axis)] = 0.0;
  return turn_rad;
}

ordered_json learned_json(const LidarOptions& lidar, const LidarTurn& turn) {
  ordered_json json{{"mounting_deg", turn_json(turn.rad, kUnknownTurns)}, {"calibrated", ordered_json::object()}};
  const Eigen::Vector3d turn_rad = known_turn_rad(turn);
  if (!turn_rad.isZero())
    json["calibrated"]["T_base_lidar"] =
        mounting_json(Pose{so3_exp(turn_rad) * lidar.T_base_lidar.rotation, lidar.T_base_lidar.translation});
  return json;
}

namespace {

std::string mounting_yaml(const char* key, const ordered_json& learned, const ordered_json& better) {
  const ordered_json& T = better.at(key);
  return fmt::format("    {}: {{xyz_m: [{}], rpy_deg: [{}]}} # sd {:.2g} degrees about x, y, z of base\n", key,
                     fmt::join(T["xyz_m"].get<std::vector<double>>(), ", "),
                     fmt::join(T["rpy_deg"].get<std::vector<double>>(), ", "),
                     fmt::join(learned.at("mounting_deg").at("sd").get<std::vector<double>>(), ", "));
}

/// Formats the configuration entry of a source, with the keys in `better`.
std::string entry_yaml(const std::string& name, const ordered_json& learned, const ordered_json& better) {
  std::string yaml =
      fmt::format("  - name: {}\n    kind: {}\n", name, learned.contains("mounting_deg") ? "imu" : "odometry");
  for (const char* const key : {"late_ms", "scale", "yaw_scale"})
    if (better.contains(key))
      yaml += fmt::format("    {}: {} # sd {:.3g}\n", key, better[key].get<double>(),
                          learned.at(key).at("sd").get<double>());
  if (better.contains("T_base_source"))
    yaml += mounting_yaml("T_base_source", learned, better);
  return yaml;
}

} // namespace

std::string calibration_yaml(const ordered_json& sources, const ordered_json& lidars) {
  std::string notes, entries, lidar_entries;
  for (const auto& [name, source] : sources.items()) {
    const ordered_json learned = source.value("learned", ordered_json::object());
    if (learned.value("too_late", false))
      notes += fmt::format("# {} arrives too late for a calibration during a drive; calibrate it from a recording:\n"
                           "# locus-replay --calibrate FILE RECORDING\n",
                           name);
    if (const ordered_json better = learned.value("calibrated", ordered_json::object()); !better.empty())
      entries += entry_yaml(name, learned, better);
  }
  for (const auto& [name, lidar] : lidars.items()) {
    const ordered_json learned = lidar.value("learned", ordered_json::object());
    if (const ordered_json better = learned.value("calibrated", ordered_json::object()); !better.empty())
      lidar_entries += fmt::format("  - name: {}\n", name) + mounting_yaml("T_base_lidar", learned, better);
  }
  if (entries.empty() && lidar_entries.empty())
    return notes + "# No learned value is better known than the configured one.\n";
  return notes + "# For the entries of the same name.\n" + (lidar_entries.empty() ? "" : "lidars:\n" + lidar_entries) +
         (entries.empty() ? "" : "motion_sources:\n" + entries);
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

/// Formats the lines of the table for a source or a lidar.
std::string lines_of(const std::string& name, const ordered_json& learned) {
  std::string text;
  const bool too_late = learned.value("too_late", false);
  for (const auto& [figure, json] : learned.items()) {
    if (figure == "mounting_deg")
      for (int axis = 0; axis < 3; ++axis)
        text += line_of(name, fmt::format("mounting_deg {}", kAxisNames[static_cast<std::size_t>(axis)]), json,
                        too_late, axis);
    else if (json.is_object() && json.contains("configured_sd"))
      text += line_of(name, figure, json, too_late);
  }
  return text;
}

} // namespace

std::string calibration_text(const ordered_json& sources, const ordered_json& lidars) {
  std::string text = fmt::format("{:<12} {:<24} {:>16} {:>20}\n", "source", "figure", "configured", "learned");
  const std::size_t head = text.size();
  for (const auto& [name, source] : sources.items()) {
    if (!source.contains("learned"))
      continue;
    const ordered_json& learned = source["learned"];
    text += lines_of(name, learned);
    const auto since_s = static_cast<std::time_t>(learned.value("since_ns", std::int64_t{0}) / 1'000'000'000);
    text += fmt::format("{:<12} since {:%F %T}\n", "", fmt::localtime(since_s));
  }
  for (const auto& [name, lidar] : lidars.items())
    if (lidar.contains("learned"))
      text += lines_of(name, lidar["learned"]);
  return text.size() > head ? text : "No motion source that calibrates itself has been received.\n";
}

namespace {

std::optional<LidarTurn> turn_of_lidars(const Figures& figures) {
  return turn_of_lidars(figures.config.motion_sources, figures.sweeps.compared);
}

/// Returns the axis about which the lidars are rotated significantly and far.
std::optional<std::size_t> gross_axis(const LidarTurn& turn) {
  for (std::size_t axis = 0; axis < turn.rad.size(); ++axis)
    if (significantly_exceeds(turn.rad[axis], kGrossLidarTurn_rad))
      return axis;
  return std::nullopt;
}

/// Tells whether a rotation of an IMU relative to lidar is that of the lidars.
bool is_of_lidars(const std::optional<LidarTurn>& lidars, std::size_t axis, double imu_turn_rad) {
  return lidars && significantly_exceeds(lidars->rad[axis], kGrossLidarTurn_rad) &&
         std::abs(imu_turn_rad + lidars->rad[axis].mean) < kSameTurn_rad;
}

/// Describes a gyro whose axes are not those of its mounting.
std::string axes_warning(const MotionSource& imu, const Eigen::Matrix3d& gyro_axes) {
  const std::optional<Pose> T_base_source = mounting_with(imu, gyro_axes);
  if (!T_base_source)
    return "reports turns about axes that are mirrored, as by no mounting: its driver exchanges or reverses axes";
  return fmt::format("turns as lidar does if it is mounted with T_base_source.rpy_deg: [{}]; configure that, unless "
                     "T_base_lidar is wrong",
                     fmt::join(mounting_json(*T_base_source)["rpy_deg"].get<std::vector<double>>(), ", "));
}

/// Describes an error in the stamps of a source; `late` is that beyond its configuration.
std::string lateness_warning(const Learned& late, double configured_ms, bool too_late) {
  if (!significantly_exceeds(late, kGrossLateness_s))
    return "";
  return fmt::format("stamps a motion {} {} lidar does{}; make its driver stamp samples when they are measured and "
                     "check the clocks of both, or {}",
                     too_late ? fmt::format("more than {:.0f} ms", 1e3 * kGrossLateness_s)
                              : fmt::format("{:.0f} ms", std::abs(1e3 * late.mean)),
                     late.mean > 0.0 ? "later than" : "earlier than", configured_ms != 0.0 ? " on top of late_ms" : "",
                     too_late ? "estimate late_ms from a recording, with locus-replay --calibrate"
                              : fmt::format("configure late_ms: {:.0f}", configured_ms + 1e3 * late.mean));
}

} // namespace

std::string lidar_mounting_warning(const Figures& figures) {
  const std::optional<LidarTurn> turn = turn_of_lidars(figures);
  const std::optional<std::size_t> axis = turn ? gross_axis(*turn) : std::nullopt;
  if (!axis)
    return "";
  std::vector<std::string> names;
  for (const LidarOptions& lidar : figures.config.lidars)
    names.push_back(lidar.name);
  const bool one = names.size() == 1;
  return fmt::format(
      "lidar{} {} {} rotated by {:+.1f} degrees about {} of the base against T_base_lidar, by the motion "
      "that {} reports; measure the mounting and correct rpy_deg, or, if {} reports its motion along "
      "other axes than those of the base, its driver",
      one ? "" : "s", fmt::join(names, ", "), one ? "is" : "are", turn->rad[*axis].mean / kRadPerDeg, kAxisNames[*axis],
      figures.config.motion_sources[turn->source].name, figures.config.motion_sources[turn->source].name);
}

std::string calibration_warning(const Figures& figures, std::size_t source) {
  const MotionSource& options = figures.config.motion_sources[source];
  if (const auto& axes = figures.ingest.sources[source].gyro_axes)
    return axes_warning(options, *axes);
  if (options.calibration == Calibration::off)
    return "";
  if (options.kind == SourceKind::odometry) {
    Learned late = lateness_s(options, findings_on(figures, source));
    late.mean -= 1e-3 * options.late_ms;
    return lateness_warning(late, options.late_ms, false);
  }
  if (!figures.sweeps.last || !figures.sweeps.last->sources[source].learned)
    return "";
  const LearnedSource& learned = *figures.sweeps.last->sources[source].learned;
  const bool too_late = is_too_late(options, learned);
  Learned late = learned.lateness_s();
  late.mean -= 1e-3 * options.late_ms;
  if (const std::string warning = lateness_warning(late, options.late_ms, too_late); !warning.empty())
    return warning;
  const std::optional<LidarTurn> lidars = turn_of_lidars(figures);
  for (std::size_t axis = 0; axis < kAxisNames.size() && !too_late; ++axis) {
    const Learned turn = learned.mounting_rad(static_cast<int>(axis));
    if (turn.sigma < kMaxMountingSigma_rad && significantly_exceeds(turn, kGrossMounting_rad) &&
        !is_of_lidars(lidars, axis, turn.mean))
      return fmt::format("is rotated by {:+.1f} degrees about {} of the base relative to lidar, against T_base_source "
                         "and T_base_lidar; measure both, and correct the wrong rpy_deg",
                         turn.mean / kRadPerDeg, kAxisNames[axis]);
  }
  return "";
}

} // namespace locus::daemon
