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

/// One point of a sweep: the centroid of neighbouring returns, or a single one.
struct SweepPoint {
  Eigen::Vector3f position_base_m; ///< base frame at the end of the sweep
  Eigen::Vector3f normal_base;     ///< unit normal of its surface towards the lidar; zero where it could not be trusted
  float age_s;                     ///< from its firing to the end of the sweep
  float intensity;
  std::uint16_t scan_line; ///< lidar index * 256 + ring
};

/// Which lidar has seen it, by index.
inline std::uint8_t lidar_of(const SweepPoint& point) { return static_cast<std::uint8_t>(point.scan_line >> 8U); }

/// Where the lidars sit on the robot, by index.
struct LidarPlaces {
  std::array<Eigen::Vector3f, kMaxLidars> base_m; ///< of the first `count`
  std::size_t count = 0;
};

/// Where the base was while a sweep came in, from where it was at its start, as its points were corrected for: at
/// instants from first to last, the last of them its end, and linear between them. What no source told is not in it;
/// without motion correction it is empty.
struct CorrectedPath {
  struct Place {
    Stamp stamp;
    Pose T_start_base;
  };
  static constexpr std::size_t kMaxPlaces = 33;

  std::array<Place, kMaxPlaces> places;
  std::size_t count = 0;
};

/// All returns of all lidars in one window of time, seen from where the base was at its end (paper L_k).
///
/// Carries the pose of every motion source at its end, so that whoever processes it can form the motion since any
/// earlier sweep, however many were dropped in between.
struct Sweep {
  std::uint64_t sequence = 0; ///< counts windows from 0
  Stamp start;
  Stamp end;                                  ///< the stamp of the sweep
  Uncorrected uncorrected = Uncorrected::all; ///< left to Odometry
  CorrectedPath path;
  std::size_t raw_returns = 0; ///< returns that came in
  SensedMotion motion;
  LidarPlaces lidars;
  std::vector<SweepPoint> points;
  std::size_t registered = 0; ///< the first so many points, spread evenly, are registered; the rest only serves the map
  /// Where SweepOptions::keeps_returns, each return that counts by itself, as fired, whatever the filters made of it.
  std::vector<SweepPoint> returns;
};

} // namespace locus
