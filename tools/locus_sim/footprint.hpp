// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "locus_sim/synthetic_lidar.hpp"

namespace locus::sim {

inline constexpr double kRangeResolution_m = 1.0; ///< closer echoes merge into one

/// Echoes of the rays of one beam: returns too close in range to be resolved merge into one echo at their
/// energy-weighted mean (mixed pixels). Internal to synthetic_lidar.cpp, in a header so that it is inlined there: each
/// beam makes one. One owner.
class SyntheticLidar::Footprint {
 public:
  void add(const std::optional<Sight>& sight, double weight) {
    if (!sight)
      return;
    const Hit& hit = sight->hit;
    const double light = weight * hit.reflectivity;
    glimpses_[count_++] = {*sight, light, light * hit.cos_incidence / (hit.range_m * hit.range_m)};
  }

  /// Sorts the hits by range, nearest first, and merges unresolved ones.
  void merge() {
    std::sort(glimpses_.begin(), glimpses_.begin() + static_cast<std::ptrdiff_t>(count_),
              [](const Glimpse& a, const Glimpse& b) { return a.sight.hit.range_m < b.sight.hit.range_m; });
    std::size_t merged = 0;
    for (std::size_t i = 0, end = 0; i < count_; i = end) {
      const double from_m = glimpses_[i].sight.hit.range_m;
      for (end = i; end < count_ && glimpses_[end].sight.hit.range_m < from_m + kRangeResolution_m;)
        ++end;
      glimpses_[merged++] = mixed(std::span(glimpses_).subspan(i, end - i));
    }
    count_ = merged;
  }

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] const Sight& last() const { return glimpses_[count_ - 1].sight; }
  [[nodiscard]] const Sight& strongest() const { return strongest_of(count_); }
  /// Returns the second strongest if the strongest is also the last, as the sensor does.
  [[nodiscard]] const Sight& strongest_beside_last() const {
    return strongest_of(std::max<std::size_t>(count_, 2) - 1);
  }

 private:
  struct Glimpse {
    Sight sight;
    double light;  ///< reflectivity times share of the beam
    double energy; ///< received, in arbitrary units
  };

  [[nodiscard]] const Sight& strongest_of(std::size_t count) const {
    return std::max_element(glimpses_.begin(), glimpses_.begin() + static_cast<std::ptrdiff_t>(count),
                            [](const Glimpse& a, const Glimpse& b) { return a.energy < b.energy; })
        ->sight;
  }

  /// Merges the parts of one echo, at the position of the brightest.
  static Glimpse mixed(std::span<const Glimpse> parts) {
    Glimpse all = *std::max_element(parts.begin(), parts.end(),
                                    [](const Glimpse& a, const Glimpse& b) { return a.energy < b.energy; });
    double light = 0, energy = 0, range = 0, slant = 0;
    for (const Glimpse& part : parts) {
      light += part.light;
      energy += part.energy;
      range += part.energy * part.sight.hit.range_m;
      slant += part.energy * part.sight.hit.cos_incidence;
    }
    all.light = light;
    all.energy = energy;
    all.sight.hit.reflectivity = static_cast<std::uint8_t>(std::clamp(std::round(light), 1.0, 255.0));
    if (energy > 0) {
      all.sight.hit.range_m = range / energy;
      all.sight.hit.cos_incidence = slant / energy;
    }
    return all;
  }

  std::array<Glimpse, 5> glimpses_;
  std::size_t count_ = 0;
};

} // namespace locus::sim
