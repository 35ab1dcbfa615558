// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/deskew.hpp"

#include <algorithm>
#include <array>

namespace locus {

namespace {

/// What turns the old correction into the new one, at a place of the path; linear from one to the next.
struct Correction {
  float age_s;
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
};
Correction correction(double age_s, const Pose& T_true_corrected) {
  return {static_cast<float>(age_s), T_true_corrected.R().cast<float>(), T_true_corrected.translation.cast<float>()};
}
using Corrections = std::array<Correction, CorrectedPath::kMaxPlaces>;

/// Precondition: there are some, from the oldest on.
Correction at_age(std::span<const Correction> corrections, float age_s) {
  const auto after = std::ranges::find_if(corrections, [=](const Correction& c) { return c.age_s <= age_s; });
  if (after == corrections.begin() || after == corrections.end())
    return after == corrections.end() ? corrections.back() : *after;
  const Correction& before = *std::prev(after);
  const float fraction = (before.age_s - age_s) / (before.age_s - after->age_s);
  return {age_s, before.R + fraction * (after->R - before.R), before.t + fraction * (after->t - before.t)};
}

void apply(std::span<const Correction> corrections, std::span<const SweepPoint> points,
           std::vector<SurfacePoint>& scan) {
  scan.clear();
  for (const SweepPoint& point : points) {
    const auto [age_s, R, t] = at_age(corrections, point.age_s);
    scan.push_back({R * point.position_base_m + t, R * point.normal_base});
  }
}

} // namespace

Vector6 corrected_twist(const Sweep& sweep) {
  const CorrectedPath& path = sweep.path;
  if (path.count < 2)
    return Vector6::Zero();
  const CorrectedPath::Place &first = path.places[0], &last = path.places[path.count - 1];
  return se3_log(first.T_start_base.inverse() * last.T_start_base) / to_seconds(last.stamp - first.stamp);
}

void correct_anew(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan) {
  Corrections corrections;
  for (std::size_t i = 0; i < sweep.path.count; ++i) {
    const CorrectedPath::Place& place = sweep.path.places[i];
    const double age_s = to_seconds(sweep.end - place.stamp);
    const Pose T_base_end = place.T_start_base.inverse() * sweep.path.places[sweep.path.count - 1].T_start_base;
    corrections[i] = correction(age_s, se3_exp(-age_s * twist_base) * T_base_end);
  }
  if (sweep.path.count == 0)
    return correct_all(sweep, twist_base, scan);
  apply(std::span(corrections).first(sweep.path.count), sweep.points, scan);
}

void correct_all(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan) {
  constexpr std::size_t kPlaces = 17;
  const Vector6 corrected = corrected_twist(sweep);
  const double oldest_s = to_seconds(sweep.end - sweep.start);
  Corrections corrections;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const double age_s = oldest_s * (1.0 - static_cast<double>(i) / (kPlaces - 1));
    corrections[i] = correction(age_s, se3_exp(-age_s * twist_base) * se3_exp(age_s * corrected));
  }
  apply(std::span(corrections).first(kPlaces), sweep.points, scan);
}

} // namespace locus
