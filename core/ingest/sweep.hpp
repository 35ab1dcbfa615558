// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// Point of a sweep: the centroid of neighbouring returns, or a single return.
struct SweepPoint {
  Eigen::Vector3f position_base_m; ///< base frame at the end of the sweep
  Eigen::Vector3f normal_base;     ///< unit normal of its surface towards the lidar; zero if unreliable
  float age_s;                     ///< from its firing to the end of the sweep
  float intensity;
  std::uint16_t scan_line; ///< lidar index * 256 + ring
};

/// Returns the index of the lidar that measured the point.
inline std::uint8_t lidar_of(const SweepPoint& point) { return static_cast<std::uint8_t>(point.scan_line >> 8U); }

/// Positions of the lidars on the robot, by index.
struct LidarPlaces {
  std::array<Eigen::Vector3f, kMaxLidars> base_m; ///< first `count` valid
  std::size_t count = 0;
};

/// Path of the base during a sweep, relative to its start, that the points were corrected for: poses at increasing
/// instants, the last one at the end of the sweep, linear in between. Motion that no source measured is not included;
/// empty without motion correction.
struct CorrectedPath {
  struct Place {
    Stamp stamp;
    Pose T_start_base;
  };
  static constexpr std::size_t kMaxPlaces = 33;

  std::array<Place, kMaxPlaces> places;
  std::size_t count = 0;
};

/// All returns of all lidars in one time window, in the base frame at its end (paper L_k).
///
/// Includes the pose of every motion source at its end, so that the motion since any earlier sweep can be computed,
/// however many were dropped in between.
struct Sweep {
  std::uint64_t sequence = 0; ///< counts windows from 0
  Stamp start;
  Stamp end;                                  ///< the stamp of the sweep
  Uncorrected uncorrected = Uncorrected::all; ///< motion that Odometry has to correct
  CorrectedPath path;
  std::size_t raw_returns = 0; ///< returns received
  SensedMotion motion;
  LidarPlaces lidars;
  std::vector<SweepPoint> points;
  std::size_t registered = 0; ///< leading points, evenly spread, that are registered; the rest is only for the map
  /// Individual returns as fired, not affected by the filters; filled if SweepOptions::keeps_returns.
  std::vector<SweepPoint> returns;
};

} // namespace locus
