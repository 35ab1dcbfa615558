// SPDX-License-Identifier: Apache-2.0
#include "daemon/calibration.hpp"

#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "core/base/pose.hpp"
#include "core/sources/motion_track.hpp"
#include "daemon/learned_figures.hpp"

namespace locus::daemon {

using nlohmann::ordered_json;

namespace {

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

} // namespace locus::daemon
