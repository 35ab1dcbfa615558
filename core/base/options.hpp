// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/isa.hpp"
#include "core/base/names.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

inline constexpr std::size_t kMaxLidars = 16; ///< per robot, at most

/// Options of the algorithm, module by module. A field has the name of its key in the YAML file, with the unit in it;
/// names_of() lists the words of an enumeration in that file. problem() returns one line "key: reason" for each invalid
/// key, or nothing if all are valid.

struct BodyBoxOptions { ///< returns inside the box come from the robot itself and are dropped
  bool enabled = false;
  Eigen::Vector3d min_m = Eigen::Vector3d::Zero(); ///< base frame
  Eigen::Vector3d max_m = Eigen::Vector3d::Zero();

  bool operator==(const BodyBoxOptions&) const = default;
};

struct SegmentFilterOptions { ///< centroids of short arcs of each ring, in firing order; its leaf follows the scene
  bool enabled = true;
  std::optional<std::size_t> points; ///< target per sweep; nothing: 2000, or 50 per scan line if more (key: auto)

  bool operator==(const SegmentFilterOptions&) const = default;
};

struct VoxelFilterOptions { ///< one centroid per voxel (paper II-A)
  bool enabled = false;
  double leaf_m = 0.1;

  bool operator==(const VoxelFilterOptions&) const = default;
};

struct RandomFilterOptions { ///< retains a seeded random share of the points (paper II-A)
  bool enabled = false;
  double keep = 0.1; ///< share retained, 0..1

  bool operator==(const RandomFilterOptions&) const = default;
};

/// Reduction of returns to the points of a sweep (paper II-A).
struct SweepOptions {
  std::optional<Duration> sweep_period; ///< nothing: one revolution of the first lidar (key sweep_period_ms: auto)
  bool motion_correction = true;
  double min_range_m = 0.5, max_range_m = 100.0; ///< key range_m: [min, max]
  BodyBoxOptions body_box;
  SegmentFilterOptions segment_filter;
  VoxelFilterOptions voxel_filter;
  RandomFilterOptions random_filter;
  std::uint64_t seed = 1;
  Isa isa = best_isa();       ///< no key: best of the machine, or the environment variable LOCUS_ISA
  bool keeps_returns = false; ///< no key: fills Sweep::returns, for a replay that writes them

  [[nodiscard]] std::optional<std::string> problem() const;
  bool operator==(const SweepOptions&) const = default;
};

enum class ScanToScanMode { always, automatic, off }; ///< automatic: at the start, while nothing predicts the motion
constexpr auto names_of(ScanToScanMode) { return std::to_array<std::string_view>({"always", "auto", "off"}); }

struct RegistrationOptions {
  int max_iterations = 20;           ///< maximum of Gauss-Newton steps
  double max_correspondence_m = 1.0; ///< gate: points farther from their correspondence are ignored

  bool operator==(const RegistrationOptions&) const = default;
};

struct MapOptions {
  double keyframe_m = 1.0;    ///< distance between keyframes, the sweeps inserted into the map ...
  double keyframe_deg = 30.0; ///< ... or rotation between them (paper II-B.3); see MapPolicy
  std::size_t max_bytes = 100'000'000;

  bool operator==(const MapOptions&) const = default;
};

enum class SourceKind { imu, odometry }; ///< imu: rotation only; odometry: all six axes
constexpr auto names_of(SourceKind) { return std::to_array<std::string_view>({"imu", "odometry"}); }

enum class UseAcceleration { automatic, off }; ///< automatic: unless it does not match gravity
constexpr auto names_of(UseAcceleration) { return std::to_array<std::string_view>({"auto", "off"}); }

/// Use of the stamp delay, mounting and scales estimated while driving: applied, only reported, or not estimated.
enum class Calibration { automatic, report, off };
constexpr auto names_of(Calibration) { return std::to_array<std::string_view>({"auto", "report", "off"}); }

/// Uncertainty of the configured values, one standard deviation; nothing: the default for an ordinary robot.
struct CalibrationSigma {
  std::optional<double> late_ms{}, mounting_deg{}; ///< of an imu
  std::optional<double> scale{}, yaw_scale{};      ///< of an odometry

  bool operator==(const CalibrationSigma&) const = default;
};

struct MotionSourceOptions {
  std::string name;
  SourceKind kind = SourceKind::odometry;
  Pose T_base_source;                                            ///< imu: mounting pose of the sensor
  UseAcceleration use_acceleration = UseAcceleration::automatic; ///< of an imu
  double late_ms = 0.0;                                          ///< delay of its stamps after the motion
  double scale = 1.0, yaw_scale = 1.0; ///< odometry: reported per true metre ahead, and per true radian of yaw
  Calibration calibration = Calibration::automatic;
  CalibrationSigma calibration_sigma{};

  bool operator==(const MotionSourceOptions&) const = default;
};

enum class Fusion { combined, queue }; ///< combined: gyro rotation with odometry translation; queue: paper II-B.1
constexpr auto names_of(Fusion) { return std::to_array<std::string_view>({"combined", "queue"}); }
enum class NoSourcePrior { constant_velocity, identity }; ///< identity: paper II-B.2
constexpr auto names_of(NoSourcePrior) { return std::to_array<std::string_view>({"constant_velocity", "identity"}); }
enum class FlatGround { off, on, automatic };
constexpr auto names_of(FlatGround) { return std::to_array<std::string_view>({"off", "on", "auto"}); }

/// Limits of the robot's motion. A motion source that reports a higher speed is rejected; a predicted excess is reduced
/// the more, the less certain it is. The acceleration is two standard deviations of the change in speed that sources
/// may report from sweep to sweep; an odometry that stops harder is frozen.
struct MotionLimits {
  double max_speed_mps = 10.0;
  double max_acceleration_mps2 = 10.0;

  bool operator==(const MotionLimits&) const = default;
};

/// Options of Odometry, except for the motion sources.
struct OdometryOptions {
  Fusion fusion = Fusion::combined;
  NoSourcePrior no_source_prior = NoSourcePrior::constant_velocity;
  MotionLimits motion;
  ScanToScanMode scan_to_scan_mode = ScanToScanMode::automatic; ///< key scan_to_scan.mode
  RegistrationOptions scan_to_scan{20, 1.0};
  RegistrationOptions scan_to_submap{20, 0.5};
  MapOptions map;
  FlatGround flat_ground = FlatGround::off;
  int threads = 2;
  Isa isa = best_isa(); ///< no key: best of the machine, or the environment variable LOCUS_ISA

  [[nodiscard]] std::optional<std::string> problem() const;
  bool operator==(const OdometryOptions&) const = default;
};

} // namespace locus
