// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/deskew.hpp"

#include <algorithm>

namespace locus {

Vector6 corrected_twist(const Sweep& sweep) {
  const CorrectedPath& path = sweep.path;
  if (path.count < 2)
    return Vector6::Zero();
  const CorrectedPath::Place& last = path.places[path.count - 1];
  return se3_log(last.T_start_base) / to_seconds(last.stamp - sweep.start);
}

SweepCorrection SweepCorrection::constant(const Sweep& sweep, const Vector6& twist_base) {
  if (sweep.path.count == 0)
    return all(sweep, twist_base);
  SweepCorrection correction;
  for (std::size_t i = 0; i < sweep.path.count; ++i) {
    const CorrectedPath::Place& place = sweep.path.places[i];
    const double age_s = to_seconds(sweep.end - place.stamp);
    const Pose T_base_end = place.T_start_base.inverse() * sweep.path.places[sweep.path.count - 1].T_start_base;
    correction.add(age_s, se3_exp(-age_s * twist_base) * T_base_end);
  }
  return correction;
}

SweepCorrection SweepCorrection::all(const Sweep& sweep, const Vector6& twist_base) {
  constexpr std::size_t kPlaces = 17;
  const Vector6 corrected = corrected_twist(sweep);
  const double oldest_s = to_seconds(sweep.end - sweep.start);
  SweepCorrection correction;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const double age_s = oldest_s * (1.0 - static_cast<double>(i) / (kPlaces - 1));
    correction.add(age_s, se3_exp(-age_s * twist_base) * se3_exp(age_s * corrected));
  }
  return correction;
}

void SweepCorrection::add(double age_s, const Pose& T_true_corrected) {
  places_[count_++] = {static_cast<float>(age_s), T_true_corrected.R().cast<float>(),
                       T_true_corrected.translation.cast<float>()};
}

/// Precondition: places_ is not empty.
SweepCorrection::Place SweepCorrection::at_age(float age_s) const {
  const std::span<const Place> places{places_.data(), count_};
  const auto after = std::ranges::find_if(places, [=](const Place& place) { return place.age_s <= age_s; });
  if (after == places.begin() || after == places.end())
    return after == places.end() ? places.back() : *after;
  const Place& before = *std::prev(after);
  const float fraction = (before.age_s - age_s) / (before.age_s - after->age_s);
  return {age_s, before.R + fraction * (after->R - before.R), before.t + fraction * (after->t - before.t)};
}

void SweepCorrection::apply(std::span<const SweepPoint> points, std::vector<SurfacePoint>& scan) const {
  scan.clear();
  for (const SweepPoint& point : points) {
    const auto [age_s, R, t] = at_age(point.age_s);
    scan.push_back({R * point.position_base_m + t, R * point.normal_base});
  }
}

} // namespace locus
