// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "locus_sim/dice.hpp"
#include "locus_sim/noise.hpp"
#include "locus_sim/surface_net.hpp"
#include "locus_sim/world.hpp"

namespace locus::sim {
namespace {

constexpr double kSite_m = 200, kHeight_m = 10;
constexpr double kHalfWidth_m = 2.6, kRoof_m = 3.6;
constexpr std::size_t kDrifts = 5;
constexpr double kSpacing_m = 40, kMargin_m = 20;
constexpr std::uint64_t kSite = 20; // fixed: the mine is the same for every seed

/// Lays out slightly crooked drifts from west to east with crosscuts between them. A third of the crosscuts are
/// missing.
Roads roads() {
  Dice dice(kSite);
  Roads roads;
  const auto about = [&](double x, double y, double reach) {
    return Eigen::Vector2d{x + dice.between(-reach, reach), y + dice.between(-reach, reach)};
  };
  std::array<std::array<Eigen::Vector2d, kDrifts>, kDrifts> crossings;
  for (std::size_t i = 0; i < kDrifts; ++i)
    for (std::size_t j = 0; j < kDrifts; ++j)
      crossings[i][j] =
          about(kMargin_m + kSpacing_m * static_cast<double>(i), kMargin_m + kSpacing_m * static_cast<double>(j), 3);
  const auto dig = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d middle = (from + to) / 2;
    roads.add({from, about(middle.x(), middle.y(), 2), to});
  };
  for (std::size_t i = 0; i < kDrifts; ++i)
    for (std::size_t j = 0; j + 1 < kDrifts; ++j) {
      dig(crossings[j][i], crossings[j + 1][i]);
      if (i == 0 || i + 1 == kDrifts || dice.chance(0.67))
        dig(crossings[i][j], crossings[i][j + 1]);
    }
  return roads;
}

/// Returns the height of the ground, with slopes of up to one in fifteen.
Jet ground_m(const Jet& x, const Jet& y) {
  constexpr double kTurn = 2 * std::numbers::pi;
  return 2.6 + 1.2 * sin(kTurn / 140 * x + 0.7) + 0.8 * sin(kTurn / 95 * y + 1.9) +
         0.1 * sin(kTurn / 17 * x + kTurn / 23 * y);
}

double square(double x) { return x * x; }

/// Signed function of the drifts, positive in air: under a blasted, rough arch, above a trodden floor.
class Drifts {
 public:
  Drifts(const Roads& roads, std::uint64_t seed) : roads_(roads), rock_(seed), aside_m_(roads.distance_m(place_m_)) {}

  double operator()(const Eigen::Vector3d& point) {
    if (point.head<2>() != place_m_) { // queried in columns, repeatedly at one place
      place_m_ = point.head<2>();
      aside_m_ = roads_.distance_m(place_m_);
    }
    if (aside_m_ > kHalfWidth_m + 1.5)
      return -1;
    const double up_m = point.z() - ground_m(point.x(), point.y()).value;
    const double rough_m = 0.28 * rock_(point / 2.7) + 0.14 * rock_(point / 1.1);
    const double aside = square(aside_m_ / kHalfWidth_m), up = square(std::max(0.0, up_m) / kRoof_m);
    const double arch = std::sqrt(std::sqrt(square(aside) + square(up))); // squarer than a circle
    return std::min(up_m - 0.12 * rough_m, kHalfWidth_m * (1 - arch) + rough_m);
  }

 private:
  const Roads& roads_;
  Noise rock_;
  Eigen::Vector2d place_m_{-1, -1};
  double aside_m_; ///< at that place
};

} // namespace

World make_tunnel(std::uint64_t) {
  Roads mine = roads();
  SceneBuilder build;
  add_surface(build, {{0, 0, -0.5}, {kSite_m, kSite_m, kHeight_m}}, 0.45, Drifts(mine, kSite), 28);
  return {.scene = build.scene(),
          .roads = std::move(mine),
          .ground_m = ground_m,
          .terrain = {.height_m = 0.025, .tilt_rad = 0.02, .wavelength_m = 2.7},
          .max_speed_mps = 1.0};
}

} // namespace locus::sim
