// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "locus_sim/hit.hpp"
#include "locus_sim/noise.hpp"

namespace locus::sim {

/// Specularly reflecting surfaces of a world: wet floor and panes of glass. Immutable, any thread.
class Mirrors {
 public:
  /// Expects shares of the level ground and of upright rectangles, 0..1.
  Mirrors(double wet, double glass, std::uint64_t seed);

  /// Returns whether the surface hit is reflecting; `surface_index` identifies it.
  [[nodiscard]] bool is_wet(const Ray& ray, const Hit& hit) const;
  [[nodiscard]] bool is_glass(const Hit& hit, std::size_t surface_index) const;

  /// Returns the lidar's measurement on such a surface: the surface itself, its mirror image (behind it, at the full
  /// length of the light path), or nothing. `cast` intersects a ray with the scene.
  using Cast = std::function<std::optional<Hit>(const Ray& ray, double max_range_m)>;
  [[nodiscard]] static std::optional<Hit> on_water(const Ray& ray, const Hit& water, double max_range_m, double chance,
                                                   const Cast& cast);
  [[nodiscard]] static std::optional<Hit> on_glass(const Ray& ray, const Hit& pane, double max_range_m, double chance,
                                                   const Cast& cast);

  [[nodiscard]] std::uint64_t seed() const { return seed_; }

 private:
  double glass_;
  std::uint64_t seed_;
  Noise puddles_;
  double wet_above_; ///< noise threshold of wet ground
};

/// Returns the share of unpolarised light that a smooth surface reflects (Fresnel); refractive `index`.
double mirrored_share(double cos_incidence, double index);

} // namespace locus::sim
