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

inline constexpr std::size_t kMaxLidars = 16; ///< of a robot, at most

/// What can be set about the algorithm, module by module. A field is named as its key in the YAML file, the unit in its
/// name, and an enumeration has the words of the file beside it. problem() says what is wrong, one line "key: reason"
/// for each key that is, and nothing when all is well.

struct BodyBoxOptions { ///< returns inside the box belong to the robot itself and are dropped
  bool enabled = false;
  Eigen::Vector3d min_m = Eigen::Vector3d::Zero(); ///< base frame
  Eigen::Vector3d max_m = Eigen::Vector3d::Zero();

  bool operator==(const BodyBoxOptions&) const = default;
};

struct SegmentFilterOptions { ///< centroids of short arcs of each ring, in firing order; its leaf follows the scene
  bool enabled = true;
  std::size_t points = 2000; ///< aimed at per sweep

  bool operator==(const SegmentFilterOptions&) const = default;
};

struct VoxelFilterOptions { ///< one centroid per voxel (paper II-A)
  bool enabled = false;
  double leaf_m = 0.1;

  bool operator==(const VoxelFilterOptions&) const = default;
};

struct RandomFilterOptions { ///< keeps a seeded random share of the points (paper II-A)
  bool enabled = false;
  double keep = 0.1; ///< share kept, 0..1

  bool operator==(const RandomFilterOptions&) const = default;
};

/// How returns become the points of a sweep (paper II-A).
struct SweepOptions {
  std::optional<Duration> sweep_period; ///< nothing: one revolution of the first lidar (key sweep_period_ms: auto)
  bool motion_correction = true;
  double min_range_m = 0.5, max_range_m = 100.0; ///< key range_m: [min, max]
  BodyBoxOptions body_box;
  SegmentFilterOptions segment_filter;
  VoxelFilterOptions voxel_filter;
  RandomFilterOptions random_filter;
  std::uint64_t seed = 1;
  Isa isa = best_isa();       ///< no key: a result of the machine, or of the environment variable LOCUS_ISA
  bool keeps_returns = false; ///< no key: Sweep::returns is filled, for a replay that writes them

  [[nodiscard]] std::optional<std::string> problem() const;
  bool operator==(const SweepOptions&) const = default;
};

enum class ScanToScanMode { always, automatic, off }; ///< automatic: at the start, where nothing predicts the motion
constexpr auto names_of(ScanToScanMode) { return std::to_array<std::string_view>({"always", "auto", "off"}); }

struct RegistrationOptions {
  int max_iterations = 20;           ///< Gauss-Newton steps at most
  double max_correspondence_m = 1.0; ///< points farther than this from their correspondence do not count

  bool operator==(const RegistrationOptions&) const = default;
};

struct MapOptions {
  double keyframe_m = 1.0;    ///< the map takes a sweep after every so many metres ...
  double keyframe_deg = 30.0; ///< ... or so many degrees (paper II-B.3)
  std::size_t max_bytes = 100'000'000;

  bool operator==(const MapOptions&) const = default;
};

enum class SourceKind { imu, odometry }; ///< imu gives rotation only, odometry all six axes
constexpr auto names_of(SourceKind) { return std::to_array<std::string_view>({"imu", "odometry"}); }

enum class UseAcceleration { automatic, off }; ///< automatic: unless it does not match gravity
constexpr auto names_of(UseAcceleration) { return std::to_array<std::string_view>({"auto", "off"}); }

/// What becomes of what a drive tells of stamps, mounting and scales: it is used, is said alone, or is not asked for.
enum class Calibration { automatic, report, off };
constexpr auto names_of(Calibration) { return std::to_array<std::string_view>({"auto", "report", "off"}); }

/// How well the user knows what is configured, one standard deviation; nothing: as of an ordinary robot.
struct CalibrationSigma {
  std::optional<double> late_ms{}, mounting_deg{}; ///< of an imu
  std::optional<double> scale{}, yaw_scale{};      ///< of an odometry

  bool operator==(const CalibrationSigma&) const = default;
};

struct MotionSourceOptions {
  std::string name;
  SourceKind kind = SourceKind::odometry;
  Pose T_base_source;                                            ///< imu: where the sensor sits and how it is turned
  UseAcceleration use_acceleration = UseAcceleration::automatic; ///< of an imu
  double late_ms = 0.0;                                          ///< its stamps, after the motion they tell of
  double scale = 1.0, yaw_scale = 1.0; ///< odometry: what it reports of a metre ahead, and of a radian of yaw
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

/// What the robot is able to. A motion source that claims a higher speed is refused, and where the speed is in doubt
/// none is predicted. Twice the standard deviation of how sources may change the speed from sweep to sweep is the
/// acceleration, and an odometry that stops harder is frozen.
struct MotionLimits {
  double max_speed_mps = 10.0;
  double max_acceleration_mps2 = 10.0;

  bool operator==(const MotionLimits&) const = default;
};

/// Everything Odometry wants to know, but for the motion sources.
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
  Isa isa = best_isa(); ///< no key: a result of the machine, or of the environment variable LOCUS_ISA

  [[nodiscard]] std::optional<std::string> problem() const;
  bool operator==(const OdometryOptions&) const = default;
};

} // namespace locus
