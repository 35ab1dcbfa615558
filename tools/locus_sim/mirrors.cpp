// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/mirrors.hpp"

#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include "locus_sim/dice.hpp"
#include "locus_sim/quick_dice.hpp"

namespace locus::sim {
namespace {

constexpr double kWater = 1.33, kPane = 1.52; // refractive indices
constexpr double kLevel = 0.993;              // cosine of 7 degrees: water runs off steeper surfaces
constexpr double kPuddle_m = 1.6;             // scale of the noise
constexpr double kWetDarker = 0.5;            // factor for the ground below the film (Lekner and Dorf, 1988)
constexpr double kPane_m = 2, kSmallest_m = 1.5;
constexpr double kStraightOn = 0.998, kGlare = 200, kDirt = 3; // within 4 degrees; mirrored and diffuse brightness
constexpr double kDarkest = 0.5;                               // lowest detectable brightness

double puddle(const Noise& noise, const Eigen::Vector3d& point) {
  return noise({point.x() / kPuddle_m, point.y() / kPuddle_m, 0});
}

/// Returns the noise value that the given share of values exceeds.
double value_above_which(const Noise& noise, double share, std::uint64_t seed) {
  constexpr std::size_t kSamples = 20'000;
  if (share <= 0)
    return 2;
  Dice dice(seed);
  std::vector<double> values;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double x = dice.between(-1000, 1000), y = dice.between(-1000, 1000);
    values.push_back(puddle(noise, {x, y, 0}));
  }
  const auto rank = static_cast<std::ptrdiff_t>((1 - share) * static_cast<double>(kSamples - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

bool is_large(const Rectangle& shape, const Eigen::Vector3d&) {
  return std::min(shape.edge_u_m.norm(), shape.edge_v_m.norm()) >= kSmallest_m;
}
/// Checks the side with this normal.
bool is_large(const Box& shape, const Eigen::Vector3d& normal) {
  const bool faces_ahead = std::abs(normal.x() * shape.cos_yaw + normal.y() * shape.sin_yaw) > 0.5;
  const double wide_m = 2 * (faces_ahead ? shape.half_size_m.y() : shape.half_size_m.x());
  return std::min(wide_m, 2 * shape.half_size_m.z()) >= kSmallest_m;
}
template <class Shape> bool is_large(const Shape&, const Eigen::Vector3d&) { return false; }

/// Returns the mirror image along a ray that hits a mirror.
std::optional<Hit> ghost(const Ray& ray, const Hit& mirror, const Eigen::Vector3d& normal, double max_range_m,
                         const Mirrors::Cast& cast) {
  constexpr double kOff_m = 1e-6; // off the surface, so that the mirrored ray does not hit it again
  const Eigen::Vector3d outwards = normal.dot(ray.direction) < 0 ? normal : -normal;
  const Eigen::Vector3d mirrored = ray.direction - 2 * outwards.dot(ray.direction) * outwards;
  auto shown = cast({mirror.point_m + kOff_m * outwards, mirrored}, max_range_m - mirror.range_m);
  if (!shown)
    return std::nullopt;
  shown->range_m += mirror.range_m;
  shown->point_m = ray.origin_m + shown->range_m * ray.direction;
  shown->surface = mirror.surface;
  shown->apparent = true;
  return shown;
}

/// Chooses between two echoes of one pulse at random, in proportion to their strength; brightnesses are given for
/// normal incidence and equal distance. Returns nothing if the chosen one is too weak.
std::optional<Hit> stronger(const Hit& own, double own_brightness, const std::optional<Hit>& ghost, double dimmed,
                            double chance) {
  const auto strength = [](const Hit& hit, double brightness) {
    return brightness * hit.cos_incidence / (hit.range_m * hit.range_m);
  };
  const double ghost_brightness = ghost ? dimmed * ghost->reflectivity : 0;
  const double of_own = strength(own, own_brightness), of_ghost = ghost ? strength(*ghost, ghost_brightness) : 0;
  const bool shows_ghost = chance * (of_own + of_ghost) < of_ghost;
  const double brightness = shows_ghost ? ghost_brightness : own_brightness;
  if (brightness < kDarkest)
    return std::nullopt;
  Hit hit = shows_ghost ? *ghost : own;
  hit.reflectivity = static_cast<std::uint8_t>(std::clamp(brightness, 1.0, 255.0));
  return hit;
}

} // namespace

double mirrored_share(double cos_incidence, double index) {
  const double sine = std::sqrt(std::max(0.0, 1 - cos_incidence * cos_incidence)) / index;
  const double cosine = std::sqrt(1 - sine * sine); // refracted ray
  const double across = (cos_incidence - index * cosine) / (cos_incidence + index * cosine);
  const double along = (index * cos_incidence - cosine) / (index * cos_incidence + cosine);
  return (across * across + along * along) / 2;
}

Mirrors::Mirrors(double wet, double glass, std::uint64_t seed)
    : glass_(glass), seed_(seed), puddles_(seed), wet_above_(value_above_which(puddles_, wet, seed)) {}

bool Mirrors::is_wet(const Ray& ray, const Hit& hit) const {
  return wet_above_ < 1 && ray.direction.z() < 0 && std::abs(hit.normal.z()) > kLevel &&
         puddle(puddles_, hit.point_m) > wet_above_;
}

bool Mirrors::is_glass(const Hit& hit, std::size_t surface_index) const {
  constexpr double kUpright = 0.05;
  const bool upright = std::abs(hit.normal.z()) < kUpright;
  if (glass_ <= 0 || !upright ||
      !std::visit([&](const auto& shape) { return is_large(shape, hit.normal); }, hit.surface->shape))
    return false;
  const double along_m = hit.normal.x() * hit.point_m.y() - hit.normal.y() * hit.point_m.x();
  const auto pane = static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(along_m / kPane_m)));
  return QuickDice(seed_ + 0x9E37'79B9U * surface_index + 0xD6E8'FEB8'6659'FD93U * pane).uniform() < glass_;
}

/// Computes the reflection at a water film; light crosses its surface on the way in and out, and wet ground looks
/// darker.
std::optional<Hit> Mirrors::on_water(const Ray& ray, const Hit& water, double max_range_m, double chance,
                                     const Cast& cast) {
  const double mirrored = mirrored_share(water.cos_incidence, kWater), through = 1 - mirrored;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ(); // water is level on rough ground, too
  return stronger(water, kWetDarker * through * through * water.reflectivity, ghost(ray, water, up, max_range_m, cast),
                  mirrored * mirrored, chance);
}

/// Computes the reflection at a pane: both faces reflect, transmitted light is lost. At normal incidence it dazzles.
std::optional<Hit> Mirrors::on_glass(const Ray& ray, const Hit& pane, double max_range_m, double chance,
                                     const Cast& cast) {
  const double face = mirrored_share(pane.cos_incidence, kPane), mirrored = 2 * face / (1 + face);
  const double own = pane.cos_incidence > kStraightOn ? kGlare : kDirt;
  return stronger(pane, own, ghost(ray, pane, pane.normal, max_range_m, cast), mirrored * mirrored, chance);
}

} // namespace locus::sim
