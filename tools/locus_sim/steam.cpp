// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/steam.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kThickest_per_m = 3; // visibility of one metre
constexpr Duration kSecond = std::chrono::seconds{1};

double age(const Cloud& cloud, Stamp stamp) {
  return std::clamp(to_seconds(stamp - cloud.begin) / to_seconds(cloud.end - cloud.begin), 0.0, 1.0);
}

} // namespace

double extinction_per_m(const Cloud& cloud, Stamp stamp) { return kThickest_per_m * (1 - age(cloud, stamp)); }

/// Returns the radius; growth is fast at first.
double radius_m(const Cloud& cloud, Stamp stamp) {
  return cloud.first_radius_m + (cloud.last_radius_m - cloud.first_radius_m) * std::sqrt(age(cloud, stamp));
}

Steam::Steam(std::vector<Cloud> clouds) : clouds_(std::move(clouds)) {
  if (clouds_.empty())
    return;
  begin_ = std::min_element(clouds_.begin(), clouds_.end(), [](const Cloud& a, const Cloud& b) {
             return a.begin < b.begin;
           })->begin;
  for (std::size_t i = 0; i < clouds_.size(); ++i) {
    const auto first = static_cast<std::size_t>((clouds_[i].begin - begin_) / kSecond);
    const auto last = static_cast<std::size_t>((clouds_[i].end - begin_) / kSecond);
    in_second_.resize(std::max(in_second_.size(), last + 1));
    for (std::size_t second = first; second <= last; ++second)
      in_second_[second].push_back(i);
  }
}

/// Samples the penetration depth of light, which is exponentially distributed.
std::optional<double> Steam::range_m(const Ray& ray, double max_range_m, Stamp stamp, QuickDice& dice) const {
  const auto second = static_cast<std::size_t>(std::max<Duration::rep>(0, (stamp - begin_) / kSecond));
  if (second >= in_second_.size() || stamp < begin_)
    return std::nullopt;
  std::optional<double> nearest_m;
  for (const std::size_t i : in_second_[second]) {
    const Cloud& cloud = clouds_[i];
    if (stamp < cloud.begin || stamp >= cloud.end)
      continue;
    const Eigen::Vector3d from_center = ray.origin_m - cloud.center_m;
    const double radius = radius_m(cloud, stamp), b = from_center.dot(ray.direction);
    const double discriminant = b * b - from_center.squaredNorm() + radius * radius;
    if (discriminant <= 0)
      continue;
    const double enter_m = std::max(0.0, -b - std::sqrt(discriminant));
    const double leave_m = std::min(max_range_m, -b + std::sqrt(discriminant));
    if (enter_m >= leave_m)
      continue;
    const double echo_m = enter_m - std::log1p(-dice.uniform()) / extinction_per_m(cloud, stamp);
    if (echo_m < leave_m && (!nearest_m || echo_m < *nearest_m))
      nearest_m = echo_m;
  }
  return nearest_m;
}

} // namespace locus::sim
