// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace locus {

namespace {

constexpr double kFarthest_m = 0.5;
constexpr double kAround_m = 2.0;

/// One standard deviation, of the robot at each of the places.
const Vector6 kSigma = along_each_axis(0.5, 5.0);

/// Share of the points of the sweep that is known: less is a coincidence, as the next bend of a tunnel offers.
constexpr double kLeast = 0.5;

/// What is asked for against the next best place: clearly more where half of the sweep is known, hardly less where four
/// fifths are.
double least_ratio(double share) {
  constexpr double kMost = 0.8, kClearlyMore = 1.3, kHardlyLess = 0.9;
  return std::lerp(kClearlyMore, kHardlyLess, std::clamp((share - kLeast) / (kMost - kLeast), 0.0, 1.0));
}

/// The expected place and those around it.
std::array<Pose, 9> places_around(const Pose& T_map_expected) {
  std::array<Pose, 9> places;
  for (int place = 0; place < 9; ++place) {
    const int ahead = place / 3 - 1, aside = place % 3 - 1;
    const Pose T_expected_place{Eigen::Quaterniond::Identity(), {ahead * kAround_m, aside * kAround_m, 0}};
    places[static_cast<std::size_t>(place)] = T_map_expected * T_expected_place;
  }
  return places;
}

} // namespace

std::optional<Pose> relocate(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map,
                             const Pose& T_map_expected, const RegistrationOptions& options) {
  MotionBelief prior;
  prior.information.topLeftCorner<6, 6>() = kSigma.cwiseAbs2().cwiseInverse().asDiagonal();
  std::optional<Pose> T_map_here;
  double here = 0.0, elsewhere = 0.0; // share of the points with a correspondence
  for (const Pose& T_start : places_around(T_map_expected)) {
    prior.T_target_source = T_start;
    const Registration found = gicp.align({scan_base}, map, T_start, prior, options, true, [] { return false; });
    const double share = static_cast<double>(found.inliers) / static_cast<double>(scan_base.size());
    const double moved_m = (found.T_target_source.translation - T_map_expected.translation).norm();
    if (!(moved_m < kFarthest_m)) {
      elsewhere = std::max(elsewhere, share);
    } else if (share > here) {
      here = share;
      T_map_here = found.T_target_source;
    }
  }
  if (here < kLeast || here < least_ratio(here) * elsewhere)
    return std::nullopt;
  return T_map_here;
}

} // namespace locus
