// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "locus_sim/hit.hpp"
#include "locus_sim/noise.hpp"

namespace locus::sim {

/// Wet floor and panes of glass: what of a world throws light back as a mirror does. Immutable, any thread.
class Mirrors {
 public:
  /// Shares of the level ground and of upright rectangles, 0..1.
  Mirrors(double wet, double glass, std::uint64_t seed);

  /// Whether what a ray has met mirrors; `surface_index` tells surfaces apart.
  [[nodiscard]] bool is_wet(const Ray& ray, const Hit& hit) const;
  [[nodiscard]] bool is_glass(const Hit& hit, std::size_t surface_index) const;

  /// What the lidar sees where its ray meets such a surface: the surface itself, what is mirrored in it (as if it lay
  /// behind, as far along the ray as the light goes), or nothing. `cast` tells what a ray meets.
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
  double wet_above_; ///< that value of the noise it is wet
};

/// Share of unpolarised light that a smooth surface mirrors (Fresnel); `index` of refraction.
double mirrored_share(double cos_incidence, double index);

} // namespace locus::sim
