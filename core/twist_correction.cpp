// SPDX-License-Identifier: Apache-2.0
#include "core/twist_correction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace locus {

namespace {

/// Takes points to the end of their sweep, for a base that moved with a constant twist while the sweep came in: exactly
/// at instants a few milliseconds apart, between them to first order.
class TwistCorrection {
 public:
  TwistCorrection(const Vector6& twist_base, double duration_s)
      : velocity_mps_(twist_base.head<3>().cast<float>()), turn_radps_(twist_base.tail<3>().cast<float>()),
        step_s_(static_cast<float>(duration_s / kInstants)) {
    for (std::size_t i = 0; i < kInstants; ++i) {
      const Pose T_end_then = se3_exp(-(static_cast<double>(i) + 0.5) * duration_s / kInstants * twist_base);
      instants_[i] = {T_end_then.R().cast<float>(), T_end_then.translation.cast<float>()};
    }
  }

  [[nodiscard]] SurfacePoint operator()(const SweepPoint& point) const {
    constexpr float kLast = kInstants - 1;
    const float i = std::clamp(std::floor(point.age_s / step_s_), 0.0F, kLast);
    const auto& [R, t] = instants_[static_cast<std::size_t>(i)];
    const float earlier_s = point.age_s - (i + 0.5F) * step_s_;
    const Eigen::Vector3f p = R * point.position_base_m + t;
    const Eigen::Vector3f n = R * point.normal_base;
    return {p - earlier_s * (turn_radps_.cross(p) + velocity_mps_), n - earlier_s * turn_radps_.cross(n)};
  }

 private:
  static constexpr std::size_t kInstants = 32;
  struct Affine {
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
  };
  Eigen::Vector3f velocity_mps_, turn_radps_;
  float step_s_;
  std::array<Affine, kInstants> instants_;
};

} // namespace

void correct_all(std::span<const SweepPoint> points, const Vector6& twist_base, Duration duration,
                 std::vector<SurfacePoint>& scan) {
  scan.clear();
  if (twist_base.isZero() || duration <= Duration::zero()) {
    for (const SweepPoint& point : points)
      scan.push_back({point.position_base_m, point.normal_base});
    return;
  }
  const TwistCorrection corrected(twist_base, to_seconds(duration));
  for (const SweepPoint& point : points)
    scan.push_back(corrected(point));
}

} // namespace locus
