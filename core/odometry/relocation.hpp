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

/// What a robot that comes to rest is slower than: m/s and rad/s.
inline const Vector6 kSlow = along_each_axis(0.05, 2.0);

/// Where a robot may be.
struct Place {
  Pose T_odom_base;
  Vector6 sigma;        ///< to look for it with: one standard deviation, m and rad
  Matrix6 covariance;   ///< against the map that another run has left, odom axes
  bool told = false;    ///< by an odometry
  bool vouched = false; ///< by one that was healthy
};

/// Where a run of the odometry ended, for another to go on from. A value.
struct Whereabouts {
  Stamp stamp; ///< end of its last sweep
  Pose T_odom_base;
  Matrix6 pose_covariance = Matrix6::Zero(); ///< as OdometryEstimate has it
  Vector6 twist_base = Vector6::Zero();      ///< mean over the last sweeps
  /// As each odometry saw the base then. Whoever sends it has not been restarted, so its frame bridges the gap.
  std::array<std::optional<Pose>, kMaxSources> T_source_base{};
  std::bitset<kMaxSources> doubted{}; ///< those that were not healthy: their wheels may have spun on
  LearnedSources learned{};           ///< of each when it was last heard

  /// After the next estimate. Its twist alone is not to be relied on, the less the less sure it is: where a source that
  /// was wrong is lost, the next sweep lies askew to those before.
  [[nodiscard]] Whereabouts followed_by(const OdometryEstimate& estimate) const;

  /// Those that it speaks of are not those of the next run.
  void forget_sources() {
    T_source_base = {};
    learned = {};
    doubted.reset();
  }

  /// Where it is at `now` if it goes on as before, which for more than a moment it does not.
  [[nodiscard]] Pose carried_to(Stamp now) const;

  /// Whether an odometry that was heard then is yet to be heard again.
  [[nodiscard]] bool awaits(const SensedMotion& sensed) const;

  /// Whether it was at rest: then it may stand there still.
  [[nodiscard]] bool stood() const;

  /// Where it may be at `now` without a word of an odometry: carried on, and wherever on its way it may have come to
  /// rest.
  [[nodiscard]] std::vector<Pose> way(Stamp now) const;

  /// Where it may be at `now`, the likeliest first: as the odometries say that it may have reached, and on its way. The
  /// farther an odometry says that it left its way, the less sure that is: whoever sends it may have been restarted. Of
  /// one that was in doubt nothing near what it says is sure. Who stood may stand there still, to the centimetres of a
  /// vouched place.
  [[nodiscard]] std::vector<Place> places(Stamp now, const SensedMotion& sensed, double max_speed_mps) const;

  /// At one of them, as far as anybody knows then.
  [[nodiscard]] Whereabouts moved_to(const Place& place) const;
};

/// A place at which a sweep was found, and how it fits there.
struct Relocated {
  Place place;
  Registration fit;
};

/// Where a sweep lies in a map that another run has left behind: within half a metre of one of the places `expected`,
/// the likeliest first, or nowhere. A healthy odometry vouches for its place: the sweep is looked for as near to it as
/// such an odometry is exact, and a place that fits hardly better does not count against it. Surfaces that tell of
/// every axis confirm it.
///
/// How much of a sweep finds a correspondence is a matter of the place: nine tenths in a tunnel, half where much is far
/// or hidden. So it is compared with what it finds two metres away on every side, and at the other places. The less of
/// the place is known, the clearer it must fit better, unless an odometry vouches for it; one of which most is known
/// may be a corridor, which looks the same two metres on, and need only fit hardly less. Of places that fit alike the
/// likelier is taken. `beyond_doubt`: it must fit clearly better however much is known. Any thread, one at a time for a
/// Gicp.
std::optional<Relocated> relocate(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map_odom,
                                  std::span<const Place> expected, const RegistrationOptions& options,
                                  bool beyond_doubt);

} // namespace locus
