// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocation.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>

namespace locus {

namespace {

constexpr double kFarthest_m = 0.5;
constexpr double kAround_m = 2.0;

/// Uncertainty of the robot about a candidate pose, one standard deviation.
const Vector6 kSigma = along_each_axis(0.5, 5.0);

/// Returns the same for a candidate from a healthy odometry, whose pose holds along directions that the surfaces
/// leave open. The error of wheels is some hundredths of the distance.
Vector6 vouched_sigma(double way_m) { return along_each_axis(std::min(0.05 + 0.04 * way_m, 0.5), 2.0); }

/// Least share of points with a correspondence: less is a coincidence, as in the next bend of a tunnel. Lower if the
/// pose is within kConfirms_m of that of an odometry, which is no coincidence.
constexpr double kLeast = 0.5, kLeastConfirmed = 0.2;
constexpr double kConfirms_m = 0.1;

/// Least ratio of the share to that of the next best pose: clearly more if half of the points have a correspondence,
/// hardly less if four fifths have one.
constexpr double kClearlyMore = 1.3, kHardlyLess = 0.9;
double least_ratio(double share) {
  constexpr double kMost = 0.8;
  return std::lerp(kClearlyMore, kHardlyLess, std::clamp((share - kLeast) / (kMost - kLeast), 0.0, 1.0));
}

/// Distance between successive candidates, so that one of them is near wherever the robot came to rest.
constexpr double kApart_m = 0.6;

/// Ratio by which a candidate must fit better than a likelier one to be preferred.
constexpr double kClearlyBetter = 1.1;

/// Returns the eight poses around a pose, kAround_m apart.
std::array<Pose, 8> places_around(const Pose& T_odom_place) {
  std::array<Pose, 8> places;
  for (int i = 0; i < 8; ++i) {
    const int cell = i < 4 ? i : i + 1, ahead = cell / 3 - 1, aside = cell % 3 - 1;
    places[static_cast<std::size_t>(i)] =
        T_odom_place * Pose{Eigen::Quaterniond::Identity(), {ahead * kAround_m, aside * kAround_m, 0}};
  }
  return places;
}

/// Returns whether the surfaces alone determine the position along each axis. If not, it stays where the search
/// started.
bool is_pinned(const Registration& fit) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(fit.information.topLeftCorner<3, 3>());
  return axes.eigenvalues().minCoeff() > 1.0 / (kConfirms_m * kConfirms_m);
}

bool is_within(double distance_m, const Pose& T_odom_a, const Pose& T_odom_b) {
  return (T_odom_a.translation - T_odom_b.translation).norm() < distance_m; // false for NaN
}

} // namespace

Whereabouts Whereabouts::followed_by(const OdometryEstimate& estimate) const {
  constexpr double kTwistMemory_s = 0.3;
  const double elapsed_s = to_seconds(estimate.stamp - stamp);
  const double share = elapsed_s > 0.0 ? 1.0 - std::exp(-elapsed_s / kTwistMemory_s) : 1.0;
  constexpr double kUnsure = 0.1; ///< m/s and rad/s, one standard deviation that halves the weight of a twist
  const Vector6 unsureness = estimate.twist_covariance.diagonal() / (kUnsure * kUnsure);
  const Vector6 news = share * (estimate.twist_base - twist_base).array() / (1.0 + unsureness.array());
  Whereabouts next{estimate.stamp, estimate.T_odom_base, estimate.pose_covariance, twist_base + news};
  for (std::size_t i = 0; i < kMaxSources; ++i) {
    next.T_source_base[i] = estimate.sources[i].T_source_base;
    next.doubted[i] = estimate.sources[i].doubted;
    next.learned[i] = estimate.sources[i].learned ? estimate.sources[i].learned : learned[i];
  }
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

bool Whereabouts::stood() const { return (twist_base.array().abs() < kSlow.array()).all(); }

std::vector<Pose> Whereabouts::way(Stamp now) const {
  constexpr double kTurnLever_m = 2.0;
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
  const auto add = [&](const Pose& place, const Pose& expected, bool told, bool vouched) {
    const Vector6 sigma = kSigma + difference(place, expected).cwiseAbs();
    const double way_m = (place.translation - T_odom_base.translation).norm();
    places.push_back({place, vouched ? vouched_sigma(way_m) : kSigma, sigma.cwiseAbs2().asDiagonal(), told, vouched});
  };
  const auto add_told = [&](std::size_t i) {
    const Pose T_then_now = T_source_base[i]->inverse() * sensed.sources[i].T_source_base;
    const Pose place = T_odom_base * (learned[i] ? learned[i]->without_scale(T_then_now) : T_then_now);
    const auto way_m = [&](const Pose& from) { return (place.translation - from.translation).norm(); };
    if (way_m(T_odom_base) > kFarthest_m + max_speed_mps * std::max(0.0, to_seconds(now - stamp)))
      return;
    const auto [nearest, farthest] = std::ranges::minmax_element(unseen, {}, way_m);
    add(place, doubted[i] ? *farthest : *nearest, true, !doubted[i]);
    const Eigen::Vector3d ahead = (place.translation - T_odom_base.translation).stableNormalized();
    for (const int k : {-1, 1, -2, 2, -3, 3})
      if (doubted[i])
        add({place.rotation, place.translation + k * kApart_m * ahead}, *farthest, false, false);
  };
  for (const bool doubtful : {false, true}) {
    for (std::size_t i = 0; i < kMaxSources; ++i)
      if (T_source_base[i] && sensed.sources[i].usable && doubted[i] == doubtful)
        add_told(i);
    if (!doubtful && stood())
      places.push_back({T_odom_base, vouched_sigma(0.0), kSigma.cwiseAbs2().asDiagonal()});
  }
  for (const Pose& place : unseen)
    add(place, T_odom_base, false, false);
  return places;
}

Whereabouts Whereabouts::moved_to(const Place& place) const {
  return {.stamp = stamp, .T_odom_base = place.T_odom_base, .pose_covariance = pose_covariance + place.covariance};
}

std::optional<Relocated> relocate(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map_odom,
                                  std::span<const Place> expected, const RegistrationOptions& options,
                                  bool beyond_doubt) {
  struct Found {
    double share = 0.0; ///< of the points, with a correspondence
    Registration fit{};
    Matrix6 covariance = Matrix6::Zero(); ///< of the candidate
    bool vouched = false;                 ///< of the candidate
    bool confirmed = false;               ///< by an odometry, and the surfaces determine every axis
  };
  MotionBelief prior;
  const auto lay = [&](const Place& place) {
    prior.information.topLeftCorner<6, 6>() = place.sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    prior.T_target_source = place.T_odom_base;
    const Registration fit =
        gicp.align({scan_base}, map_odom, place.T_odom_base, prior, options, true, [] { return false; });
    return Found{static_cast<double>(fit.inliers) / static_cast<double>(scan_base.size()), fit, place.covariance,
                 place.vouched,
                 place.told && is_within(kConfirms_m, fit.T_target_source, place.T_odom_base) && is_pinned(fit)};
  };
  std::vector<Found> all;
  Found here;
  for (const Place& place : expected) {
    all.push_back(lay(place));
    if (is_within(kFarthest_m, all.back().fit.T_target_source, place.T_odom_base) &&
        all.back().share > kClearlyBetter * here.share)
      here = all.back();
  }
  if (here.share < (here.confirmed ? kLeastConfirmed : kLeast))
    return std::nullopt;
  for (const Pose& T_odom_beside : places_around(here.fit.T_target_source))
    all.push_back(lay({T_odom_beside, kSigma, Matrix6::Zero()}));
  const double least = here.vouched || here.confirmed ? kHardlyLess
                       : beyond_doubt                 ? kClearlyMore
                                                      : least_ratio(here.share);
  for (const Found& other : all)
    if (!is_within(kFarthest_m, other.fit.T_target_source, here.fit.T_target_source) &&
        here.share < least * other.share)
      return std::nullopt;
  const Matrix6 information = here.covariance.inverse() + here.fit.information.topLeftCorner<6, 6>();
  return Relocated{{here.fit.T_target_source, kSigma, information.inverse()}, here.fit};
}

} // namespace locus
