// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "core/base/pose.hpp"
#include "daemon/calibration.hpp"
#include "daemon/learned_figures.hpp"

namespace locus::daemon {

namespace {

constexpr double kGrossLateness_s = 0.03, kGrossMounting_rad = 3.0 * kRadPerDeg;
constexpr double kSignificance_sigma = 5.0;              ///< least significance above these limits
constexpr double kGrossLidarTurn_rad = 2.0 * kRadPerDeg; ///< a climb of 35 mm in a metre
constexpr double kSameTurn_rad = 1.5 * kRadPerDeg;       ///< largest difference of two observations of one rotation
/// Largest sigma of a reported mounting; hard driving biases less certain ones.
constexpr double kMaxMountingSigma_rad = 0.01;

bool significantly_exceeds(const Learned& figure, double limit) {
  return std::abs(figure.mean) - kSignificance_sigma * figure.sigma > limit;
}

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
