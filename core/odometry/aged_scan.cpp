// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/aged_scan.hpp"

#include <algorithm>
#include <array>

namespace locus {

ElasticScan AgedScan::sort(const Sweep& sweep, std::span<const SurfacePoint> scan_base, const Vector6& twist_base) {
  constexpr std::size_t kBins = 64; // per sweep: one or two milliseconds each
  const auto count = static_cast<std::size_t>(sweep.registered);
  const double oldest_s = std::max(1e-9, to_seconds(sweep.end - sweep.start));
  const auto bin = [&](std::size_t i) {
    const double share = static_cast<double>(sweep.points[i].age_s) / oldest_s;
    return static_cast<std::size_t>(std::clamp(share, 0.0, 0.999) * kBins);
  };
  std::array<std::size_t, kBins + 1> begins{};
  for (std::size_t i = 0; i < count; ++i)
    ++begins[bin(i) + 1];
  for (std::size_t b = 0; b < kBins; ++b)
    begins[b + 1] += begins[b];
  points_base_.resize(count);
  age_s_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = begins[bin(i)]++;
    points_base_[place] = scan_base[i];
    age_s_[place] = sweep.points[i].age_s;
  }
  return {.points = points_base_, .age_s = age_s_, .twist_base = twist_base};
}

} // namespace locus
