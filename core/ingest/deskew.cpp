// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/deskew.hpp"

#include <algorithm>
#include <array>

namespace locus {

namespace {

constexpr std::size_t kAtATime = 64; ///< points; their figures stay in the fastest cache
using PerPointAtATime = std::array<float, kAtATime>;

struct Vectors {
  PerPointAtATime x{}, y{}, z{};
  void set(std::size_t i, const Eigen::Vector3f& v) {
    x[i] = v.x();
    y[i] = v.y();
    z[i] = v.z();
  }
  [[nodiscard]] Eigen::Vector3f operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// exp(-age twist) v as its power series, Horner's way: v - age (w x (v - age/2 (w x (v - ...) + u)) + u) for a
/// velocity u and a turn rate w. Beyond the sixth term, half a radian moves a point a hundred metres away by a tenth of
/// a millimetre.
[[gnu::always_inline]] inline Vectors moved_back(const Vectors& v, const PerPointAtATime& age_s,
                                                 const Eigen::Vector3f& u, const Eigen::Vector3f& w) {
  constexpr int kTerms = 6;
  const float ux = u.x(), uy = u.y(), uz = u.z(), wx = w.x(), wy = w.y(), wz = w.z();
  Vectors moved;
  for (std::size_t i = 0; i < kAtATime; ++i) {
    float x = v.x[i], y = v.y[i], z = v.z[i];
    for (int term = kTerms; term > 0; --term) {
      const float share_s = age_s[i] / static_cast<float>(term);
      const float dx = wy * z - wz * y + ux, dy = wz * x - wx * z + uy, dz = wx * y - wy * x + uz;
      x = v.x[i] - share_s * dx;
      y = v.y[i] - share_s * dy;
      z = v.z[i] - share_s * dz;
    }
    moved.x[i] = x;
    moved.y[i] = y;
    moved.z[i] = z;
  }
  return moved;
}

/// What turns the old correction into the new one, at a place of the path; linear from one to the next.
struct Correction {
  float age_s;
  Eigen::Matrix3f R;
  Eigen::Vector3f t;
};
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

} // namespace

void correct_anew(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan) {
  Corrections corrections;
  for (std::size_t i = 0; i < sweep.path.count; ++i) {
    const CorrectedPath::Place& place = sweep.path.places[i];
    const double age_s = to_seconds(sweep.end - place.stamp);
    const Pose T_base_end = place.T_start_base.inverse() * sweep.path.places[sweep.path.count - 1].T_start_base;
    const Pose T_true_corrected = se3_exp(-age_s * twist_base) * T_base_end;
    corrections[i] = {static_cast<float>(age_s), T_true_corrected.R().cast<float>(),
                      T_true_corrected.translation.cast<float>()};
  }
  const std::span known = std::span(corrections).first(sweep.path.count);
  scan.clear();
  for (const SweepPoint& point : sweep.points) {
    const auto [age_s, R, t] = known.empty() ? Correction{0, Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero()}
                                             : at_age(known, point.age_s);
    scan.push_back({R * point.position_base_m + t, R * point.normal_base});
  }
}

void correct_all(std::span<const SweepPoint> points, const Vector6& twist_base, Isa isa,
                 std::vector<SurfacePoint>& scan) {
  scan.clear();
  if (twist_base.isZero()) {
    for (const SweepPoint& point : points)
      scan.push_back({point.position_base_m, point.normal_base});
    return;
  }
  const Eigen::Vector3f velocity_mps = twist_base.head<3>().cast<float>();
  const Eigen::Vector3f turn_radps = twist_base.tail<3>().cast<float>();
  Vectors positions, normals;
  PerPointAtATime age_s{};
  while (!points.empty()) {
    const std::span<const SweepPoint> some = points.first(std::min(kAtATime, points.size()));
    for (std::size_t i = 0; i < some.size(); ++i) {
      positions.set(i, some[i].position_base_m);
      normals.set(i, some[i].normal_base);
      age_s[i] = some[i].age_s;
    }
    run_as(isa, [&] {
      positions = moved_back(positions, age_s, velocity_mps, turn_radps);
      normals = moved_back(normals, age_s, Eigen::Vector3f::Zero(), turn_radps);
    });
    for (std::size_t i = 0; i < some.size(); ++i)
      scan.push_back({positions[i], normals[i]});
    points = points.subspan(some.size());
  }
}

} // namespace locus
