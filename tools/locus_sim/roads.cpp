// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/roads.hpp"

#include <algorithm>
#include <limits>
#include <optional>

namespace locus::sim {

void Roads::add(std::initializer_list<Eigen::Vector2d> polyline_m) {
  std::optional<std::size_t> last;
  for (const Eigen::Vector2d& at_m : polyline_m) {
    const std::size_t next = place(at_m);
    if (last)
      lanes_.push_back({*last, next});
    last = next;
  }
}

std::size_t Roads::place(const Eigen::Vector2d& at_m) {
  constexpr double kSame_m = 1e-3;
  const auto known = std::find_if(places_m_.begin(), places_m_.end(),
                                  [&](const Eigen::Vector2d& other) { return (other - at_m).norm() < kSame_m; });
  const auto index = static_cast<std::size_t>(known - places_m_.begin());
  if (known == places_m_.end())
    places_m_.push_back(at_m);
  return index;
}

double Roads::distance_m(const Eigen::Vector2d& point) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Lane& lane : lanes_) {
    const Eigen::Vector2d along = places_m_[lane.to] - places_m_[lane.from], from_begin = point - places_m_[lane.from];
    const double share = std::clamp(from_begin.dot(along) / along.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (from_begin - share * along).norm());
  }
  return nearest;
}

} // namespace locus::sim
