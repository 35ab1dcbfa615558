// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bitset>
#include <optional>
#include <span>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/map/registration.hpp"
#include "core/map/surface_map.hpp"
#include "core/odometry/odometry_estimate.hpp"

namespace locus {

/// Twist below which a robot counts as at rest: m/s and rad/s.
inline const Vector6 kSlow = along_each_axis(0.05, 2.0);

/// Candidate pose of the robot.
struct Candidate {
  Pose T_odom_base;
  Vector6 sigma;              ///< of the search: one standard deviation, m and rad
  Matrix6 covariance;         ///< relative to the map of the earlier run, odom axes
  bool from_odometry = false; ///< from an odometry
  bool from_healthy = false;  ///< from one that was healthy
};

/// State at the end of a run of the odometry, from which another run resumes. A value.
struct ResumeState {
  Stamp stamp; ///< end of its last sweep
  Pose T_odom_base;
  Matrix6 pose_covariance = Matrix6::Zero(); ///< as in OdometryEstimate
  Vector6 twist_base = Vector6::Zero();      ///< mean over the last sweeps
  /// Pose of the base from each odometry at that time. Its frame bridges the gap unless the source was restarted.
  std::array<std::optional<Pose>, kMaxSources> T_source_base{};
  std::bitset<kMaxSources> doubted{}; ///< odometries that were not healthy: wheels may have kept spinning
  LearnedSources learned{};           ///< of each source when last received

  /// Returns the state after the next estimate. The twist is low-pass filtered (0.3 s) and weighted by its covariance:
  /// when a faulty source is lost, the next sweep is offset from those before.
  [[nodiscard]] ResumeState followed_by(const OdometryEstimate& estimate) const;

  /// Drops the data of the motion sources, when those of the next run are different ones.
  void drop_sources() {
    T_source_base = {};
    learned = {};
    doubted.reset();
  }

  /// Returns the pose at `now` at constant twist, which is assumed for 2 s at most.
  [[nodiscard]] Pose extrapolated_to(Stamp now) const;

  /// Returns whether an odometry that was received then has not been received again yet.
  [[nodiscard]] bool awaits(const SensedMotion& sensed) const;

  /// Returns whether the robot was at rest, so that it may still be there.
  [[nodiscard]] bool was_at_rest() const;

  /// Returns the candidate poses at `now` without odometry: constant velocity, and stops along that path.
  [[nodiscard]] std::vector<Pose> way(Stamp now) const;

  /// Returns the candidate poses at `now`, the likeliest first: those of the odometries, if reachable, and along the
  /// path without odometry. The farther an odometry is from that path the less certain its pose, since the source may
  /// have been restarted. A source that was in doubt is less certain still and adds candidates ahead of and behind its
  /// pose. A robot that was at rest may still be there, to the centimetres of a pose from a healthy odometry.
  [[nodiscard]] std::vector<Candidate> candidates(Stamp now, const SensedMotion& sensed, double max_speed_mps) const;

  /// Returns the state at a candidate; its twist and sources are left unset.
  [[nodiscard]] ResumeState moved_to(const Candidate& candidate) const;
};

/// Candidate at which a sweep was found, and its registration.
struct Relocalised {
  Candidate candidate;
  Registration fit;
};

/// Relocalises a sweep in the map of an earlier run: within half a metre of one of the candidates `expected`, the
/// likeliest first. Returns nothing if it is not found or the result is ambiguous. A healthy odometry vouches for its
/// candidate: the search there is as narrow as such an odometry is accurate, and another pose that fits hardly better
/// does not rule it out. Surfaces that determine every axis confirm it.
///
/// The share of points with a correspondence depends on the surroundings: nine tenths in a tunnel, half where much is
/// far away or hidden. It is therefore compared with the share two metres away on every side and at the other
/// candidates. The smaller the share, the more clearly it must exceed theirs, unless an odometry vouches for the
/// candidate; a large share may be that of a corridor, which looks the same two metres on, and need only be hardly
/// less. Among equal fits the likelier candidate is chosen. Any thread, one at a time for a Gicp.
std::optional<Relocalised> relocalise(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map_odom,
                                      std::span<const Candidate> expected, const RegistrationOptions& options);

} // namespace locus
