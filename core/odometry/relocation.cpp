// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace locus {

namespace {

constexpr double kFarthest_m = 0.5;
constexpr double kAround_m = 2.0;

/// One standard deviation of a robot about a place.
const Vector6 kSigma = along_each_axis(0.5, 5.0);

/// Share of the points of the sweep that is known: less is a coincidence, as the next bend of a tunnel offers. What
/// lies where an odometry says, that close, is none.
constexpr double kLeast = 0.5, kLeastVouched = 0.2;
constexpr double kVouched_m = 0.1;

/// What is asked for against the next best place: clearly more where half of the sweep is known, hardly less where four
/// fifths are.
constexpr double kClearlyMore = 1.3, kHardlyLess = 0.9;
double least_ratio(double share) {
  constexpr double kMost = 0.8;
  return std::lerp(kClearlyMore, kHardlyLess, std::clamp((share - kLeast) / (kMost - kLeast), 0.0, 1.0));
}

/// A place is taken for a likelier one if it fits so much better.
constexpr double kClearlyBetter = 1.1;

/// Beside a place, on every side.
std::array<Pose, 8> places_around(const Pose& T_odom_place) {
  std::array<Pose, 8> places;
  for (int i = 0; i < 8; ++i) {
    const int cell = i < 4 ? i : i + 1, ahead = cell / 3 - 1, aside = cell % 3 - 1;
    places[static_cast<std::size_t>(i)] =
        T_odom_place * Pose{Eigen::Quaterniond::Identity(), {ahead * kAround_m, aside * kAround_m, 0}};
  }
  return places;
}

/// Whether the surfaces alone tell where it is, along each axis. Where they do not it lies wherever it was laid.
bool is_pinned(const Registration& fit) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(fit.information.topLeftCorner<3, 3>());
  return axes.eigenvalues().minCoeff() > 1.0 / (kVouched_m * kVouched_m);
}

bool is_within(double distance_m, const Pose& T_odom_a, const Pose& T_odom_b) {
  return (T_odom_a.translation - T_odom_b.translation).norm() < distance_m; // false for NaN
}

} // namespace

Whereabouts Whereabouts::followed_by(const OdometryEstimate& estimate) const {
  constexpr double kTwistMemory_s = 0.3;
  const double elapsed_s = to_seconds(estimate.stamp - stamp);
  const double share = elapsed_s > 0.0 ? 1.0 - std::exp(-elapsed_s / kTwistMemory_s) : 1.0;
  constexpr double kUnsure = 0.1; ///< m/s and rad/s, one standard deviation: of such a twist one half is taken
  const Vector6 unsureness = estimate.twist_covariance.diagonal() / (kUnsure * kUnsure);
  const Vector6 news = share * (estimate.twist_base - twist_base).array() / (1.0 + unsureness.array());
  Whereabouts next{estimate.stamp, estimate.T_odom_base, estimate.pose_covariance, twist_base + news};
  std::ranges::transform(estimate.sources, next.T_source_base.begin(), &SourceReport::T_source_base);
  return next;
}

Pose Whereabouts::carried_to(Stamp now) const {
  constexpr Duration kMoment = std::chrono::seconds{2};
  return T_odom_base * se3_exp(to_seconds(std::clamp(now - stamp, Duration::zero(), kMoment)) * twist_base);
}

bool Whereabouts::awaits(const SensedMotion& sensed) const {
  for (std::size_t i = 0; i < kMaxSources; ++i)
    if (T_source_base[i] && !sensed.sources[i].usable)
      return true;
  return false;
}

std::vector<Pose> Whereabouts::way(Stamp now) const {
  constexpr double kApart_m = 0.6, kTurnLever_m = 2.0; // so that one of them is near wherever it came to rest
  constexpr int kMost = 16;
  const double elapsed_s = std::max(0.0, to_seconds(now - stamp));
  const double apart_s =
      kApart_m / std::max(1e-3, twist_base.head<3>().norm() + kTurnLever_m * twist_base.tail<3>().norm());
  std::vector<Pose> way{carried_to(now)};
  for (int i = 0; i < kMost && i * apart_s < elapsed_s; ++i)
    way.push_back(T_odom_base * se3_exp(i * apart_s * twist_base));
  return way;
}

std::vector<Place> Whereabouts::places(Stamp now, const SensedMotion& sensed, double max_speed_mps) const {
  const std::vector<Pose> unseen = way(now);
  std::vector<Place> places;
  const auto add = [&](const Pose& place, const Pose& expected, bool told) {
    const Vector6 sigma = kSigma + difference(place, expected).cwiseAbs();
    places.push_back({place, sigma.cwiseAbs2().asDiagonal(), told});
  };
  for (std::size_t i = 0; i < kMaxSources; ++i)
    if (T_source_base[i] && sensed.sources[i].usable) {
      const Pose place = T_odom_base * T_source_base[i]->inverse() * sensed.sources[i].T_source_base;
      const auto way_m = [&](const Pose& from) { return (place.translation - from.translation).norm(); };
      if (way_m(T_odom_base) <= kFarthest_m + max_speed_mps * std::max(0.0, to_seconds(now - stamp)))
        add(place, *std::ranges::min_element(unseen, {}, way_m), true);
    }
  for (const Pose& place : unseen)
    add(place, T_odom_base, false);
  return places;
}

Whereabouts Whereabouts::moved_to(const Place& place) const {
  return {.stamp = stamp, .T_odom_base = place.T_odom_base, .pose_covariance = pose_covariance + place.covariance};
}

std::optional<Place> relocate(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map_odom,
                              std::span<const Place> expected, const RegistrationOptions& options, bool beyond_doubt) {
  struct Found {
    double share = 0.0; ///< of the points, with a correspondence
    Registration fit{};
    Matrix6 covariance = Matrix6::Zero(); ///< of the place
    bool vouched = false;
  };
  MotionBelief prior;
  prior.information.topLeftCorner<6, 6>() = kSigma.cwiseAbs2().cwiseInverse().asDiagonal();
  const auto lay = [&](const Place& place) {
    prior.T_target_source = place.T_odom_base;
    const Registration fit =
        gicp.align({scan_base}, map_odom, place.T_odom_base, prior, options, true, [] { return false; });
    return Found{static_cast<double>(fit.inliers) / static_cast<double>(scan_base.size()), fit, place.covariance,
                 place.told && is_within(kVouched_m, fit.T_target_source, place.T_odom_base) && is_pinned(fit)};
  };
  std::vector<Found> all;
  Found here;
  for (const Place& place : expected) {
    all.push_back(lay(place));
    if (is_within(kFarthest_m, all.back().fit.T_target_source, place.T_odom_base) &&
        all.back().share > kClearlyBetter * here.share)
      here = all.back();
  }
  if (here.share < (here.vouched ? kLeastVouched : kLeast))
    return std::nullopt;
  for (const Pose& T_odom_beside : places_around(here.fit.T_target_source))
    all.push_back(lay({T_odom_beside, Matrix6::Zero()}));
  const double least = here.vouched ? kHardlyLess : beyond_doubt ? kClearlyMore : least_ratio(here.share);
  for (const Found& other : all)
    if (!is_within(kFarthest_m, other.fit.T_target_source, here.fit.T_target_source) &&
        here.share < least * other.share)
      return std::nullopt;
  const Matrix6 information = here.covariance.inverse() + here.fit.information.topLeftCorner<6, 6>();
  return Place{here.fit.T_target_source, information.inverse()};
}

} // namespace locus
