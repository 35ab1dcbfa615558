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
Vector6 healthy_sigma(double way_m) { return along_each_axis(std::min(0.05 + 0.04 * way_m, 0.5), 2.0); }

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
  std::array<Pose, 8> candidates;
  for (int i = 0; i < 8; ++i) {
    const int cell = i < 4 ? i : i + 1, ahead = cell / 3 - 1, aside = cell % 3 - 1;
    candidates[static_cast<std::size_t>(i)] =
        T_odom_place * Pose{Eigen::Quaterniond::Identity(), {ahead * kAround_m, aside * kAround_m, 0}};
  }
  return candidates;
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

ResumeState ResumeState::followed_by(const OdometryEstimate& estimate) const {
  constexpr double kTwistMemory_s = 0.3;
  const double elapsed_s = to_seconds(estimate.stamp - stamp);
  const double share = elapsed_s > 0.0 ? 1.0 - std::exp(-elapsed_s / kTwistMemory_s) : 1.0;
  constexpr double kUnsure = 0.1; ///< m/s and rad/s, one standard deviation that halves the weight of a twist
  const Vector6 unsureness = estimate.twist_covariance.diagonal() / (kUnsure * kUnsure);
  const Vector6 change = share * (estimate.twist_base - twist_base).array() / (1.0 + unsureness.array());
  ResumeState next{estimate.stamp, estimate.T_odom_base, estimate.pose_covariance, twist_base + change};
  for (std::size_t i = 0; i < kMaxSources; ++i) {
    next.T_source_base[i] = estimate.sources[i].T_source_base;
    next.doubted[i] = estimate.sources[i].doubted;
    next.learned[i] = estimate.sources[i].learned ? estimate.sources[i].learned : learned[i];
  }
  return next;
}

Pose ResumeState::extrapolated_to(Stamp now) const {
  constexpr Duration kMoment = std::chrono::seconds{2};
  return T_odom_base * se3_exp(to_seconds(std::clamp(now - stamp, Duration::zero(), kMoment)) * twist_base);
}

bool ResumeState::awaits(const SensedMotion& sensed) const {
  for (std::size_t i = 0; i < kMaxSources; ++i)
    if (T_source_base[i] && !sensed.sources[i].usable)
      return true;
  return false;
}

bool ResumeState::was_at_rest() const { return (twist_base.array().abs() < kSlow.array()).all(); }

std::vector<Pose> ResumeState::way(Stamp now) const {
  constexpr double kTurnLever_m = 2.0;
  constexpr int kMost = 16;
  const double elapsed_s = std::max(0.0, to_seconds(now - stamp));
  const double apart_s =
      kApart_m / std::max(1e-3, twist_base.head<3>().norm() + kTurnLever_m * twist_base.tail<3>().norm());
  std::vector<Pose> way{extrapolated_to(now)};
  for (int i = 0; i < kMost && i * apart_s < elapsed_s; ++i)
    way.push_back(T_odom_base * se3_exp(i * apart_s * twist_base));
  return way;
}

std::vector<Candidate> ResumeState::candidates(Stamp now, const SensedMotion& sensed, double max_speed_mps) const {
  const std::vector<Pose> path = way(now);
  std::vector<Candidate> candidates;
  const auto add = [&](const Pose& candidate, const Pose& expected, bool from_odometry, bool from_healthy) {
    const Vector6 sigma = kSigma + difference(candidate, expected).cwiseAbs();
    const double way_m = (candidate.translation - T_odom_base.translation).norm();
    candidates.push_back({candidate, from_healthy ? healthy_sigma(way_m) : kSigma, sigma.cwiseAbs2().asDiagonal(),
                          from_odometry, from_healthy});
  };
  const auto add_odometry = [&](std::size_t i) {
    const Pose T_then_now = T_source_base[i]->inverse() * sensed.sources[i].T_source_base;
    const Pose candidate = T_odom_base * (learned[i] ? learned[i]->without_scale(T_then_now) : T_then_now);
    const auto way_m = [&](const Pose& from) { return (candidate.translation - from.translation).norm(); };
    if (way_m(T_odom_base) > kFarthest_m + max_speed_mps * std::max(0.0, to_seconds(now - stamp)))
      return;
    const auto [nearest, farthest] = std::ranges::minmax_element(path, {}, way_m);
    add(candidate, doubted[i] ? *farthest : *nearest, true, !doubted[i]);
    const Eigen::Vector3d ahead = (candidate.translation - T_odom_base.translation).stableNormalized();
    for (const int k : {-1, 1, -2, 2, -3, 3})
      if (doubted[i])
        add({candidate.rotation, candidate.translation + k * kApart_m * ahead}, *farthest, false, false);
  };
  for (const bool doubtful : {false, true}) {
    for (std::size_t i = 0; i < kMaxSources; ++i)
      if (T_source_base[i] && sensed.sources[i].usable && doubted[i] == doubtful)
        add_odometry(i);
    if (!doubtful && was_at_rest())
      candidates.push_back({T_odom_base, healthy_sigma(0.0), kSigma.cwiseAbs2().asDiagonal()});
  }
  for (const Pose& candidate : path)
    add(candidate, T_odom_base, false, false);
  return candidates;
}

ResumeState ResumeState::moved_to(const Candidate& candidate) const {
  return {
      .stamp = stamp, .T_odom_base = candidate.T_odom_base, .pose_covariance = pose_covariance + candidate.covariance};
}

std::optional<Relocalised> relocalise(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map_odom,
                                      std::span<const Candidate> expected, const RegistrationOptions& options) {
  struct Found {
    double share = 0.0; ///< of the points, with a correspondence
    Registration fit{};
    Matrix6 covariance = Matrix6::Zero(); ///< of the candidate
    bool from_healthy = false;            ///< of the candidate
    bool confirmed = false;               ///< by an odometry, and the surfaces determine every axis
  };
  MotionBelief prior;
  const auto align_at = [&](const Candidate& candidate) {
    prior.information.topLeftCorner<6, 6>() = candidate.sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    prior.T_target_source = candidate.T_odom_base;
    const Registration fit =
        gicp.align({scan_base}, map_odom, candidate.T_odom_base, prior, options, true, [] { return false; });
    return Found{static_cast<double>(fit.inliers) / static_cast<double>(scan_base.size()), fit, candidate.covariance,
                 candidate.from_healthy,
                 candidate.from_odometry && is_within(kConfirms_m, fit.T_target_source, candidate.T_odom_base) &&
                     is_pinned(fit)};
  };
  std::vector<Found> all;
  Found here;
  for (const Candidate& candidate : expected) {
    all.push_back(align_at(candidate));
    if (is_within(kFarthest_m, all.back().fit.T_target_source, candidate.T_odom_base) &&
        all.back().share > kClearlyBetter * here.share)
      here = all.back();
  }
  if (here.share < (here.confirmed ? kLeastConfirmed : kLeast))
    return std::nullopt;
  for (const Pose& T_odom_beside : places_around(here.fit.T_target_source))
    all.push_back(align_at({T_odom_beside, kSigma, Matrix6::Zero()}));
  const double least = here.from_healthy || here.confirmed ? kHardlyLess : least_ratio(here.share);
  for (const Found& other : all)
    if (!is_within(kFarthest_m, other.fit.T_target_source, here.fit.T_target_source) &&
        here.share < least * other.share)
      return std::nullopt;
  const Matrix6 information = here.covariance.inverse() + here.fit.information.topLeftCorner<6, 6>();
  return Relocalised{{here.fit.T_target_source, kSigma, information.inverse()}, here.fit};
}

} // namespace locus
