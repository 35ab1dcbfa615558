// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numbers>
#include <utility>

namespace locus::sim {
namespace {

constexpr std::size_t kStackSize = 256; // three more per level

/// Nodes still to visit, unless a nearer hit is found. Two arrays: reading two separately written halves as a whole
/// would stall the processor (store forwarding).
struct Waiting {
  std::array<std::uint32_t, kStackSize> child;
  std::array<float, kStackSize> enter_m;
};

double squared_distance(const Bounds& box, const Eigen::Vector3d& point) {
  return (point - point.cwiseMax(box.min_m).cwiseMin(box.max_m)).squaredNorm();
}

double range_m(const Surface& surface, const Ray& ray) {
  return std::visit([&](const auto& shape) { return shape.range_m(ray); }, surface.shape);
}

double distance_m(const Surface& surface, const Eigen::Vector3d& point) {
  return std::visit([&](const auto& shape) { return shape.distance_m(point); }, surface.shape);
}

bool passes_through(const Eigen::Array3d& origin, const Eigen::Array3d& inverse, const Bounds& box,
                    double max_range_m) {
  const Eigen::Array3d a = (box.min_m.array() - origin) * inverse, b = (box.max_m.array() - origin) * inverse;
  return std::max(0.0, a.min(b).maxCoeff()) <= std::min(max_range_m, a.max(b).minCoeff());
}

/// Seeds by the ray, so that the result does not depend on earlier rays.
QuickDice dice_of(const Ray& ray, Stamp stamp) {
  auto seed = static_cast<std::uint64_t>(stamp.time_since_epoch().count());
  for (const double coordinate : ray.direction)
    seed = (seed ^ std::bit_cast<std::uint64_t>(coordinate)) * 0x9E37'79B9'7F4A'7C15U;
  return QuickDice(seed);
}

} // namespace

Eigen::Vector3d Mover::position_m(Stamp stamp) const {
  const double turns = std::fmod(to_seconds(stamp.time_since_epoch()), period_s) / period_s + phase;
  return from_m + 0.5 * (1 - std::cos(2 * std::numbers::pi * turns)) * (to_m - from_m);
}

Bounds Mover::bounds() const {
  const Bounds own = bounds_of(parts);
  return united({own.min_m + from_m, own.max_m + from_m}, {own.min_m + to_m, own.max_m + to_m});
}

Scene::Scene(std::vector<Surface> surfaces, std::vector<Mover> movers, std::vector<Passer> passers)
    : surfaces_(std::move(surfaces)), movers_(std::move(movers)), passers_(std::move(passers)),
      bounds_(bounds_of(surfaces_)) {
  nodes_ = make_tree(surfaces_);
  std::transform(movers_.begin(), movers_.end(), std::back_inserter(mover_bounds_),
                 [](const Mover& mover) { return mover.bounds(); });
}

void Scene::cast_at_surfaces(const Ray& ray, Met& nearest) const {
  const Eigen::Array3f origin = ray.origin_m.cast<float>();
  const Eigen::Array3f inverse =
      ray.direction.cast<float>().array().unaryExpr([](float d) { return 1.0F / (d == 0.0F ? 1e-30F : d); });
  Waiting waiting;
  std::size_t depth = 0;
  const auto put = [&](std::size_t place, std::uint32_t child, float enter_m) {
    waiting.child[place] = child;
    waiting.enter_m[place] = enter_m;
  };
  if (!nodes_.empty())
    put(depth++, static_cast<std::uint32_t>(nodes_.size() - 1), 0);
  while (depth > 0) {
    --depth;
    if (waiting.enter_m[depth] > static_cast<float>(nearest.range_m))
      continue;
    const std::uint32_t next = waiting.child[depth];
    if ((next & kSurface) != 0) {
      const Surface& surface = surfaces_[next - kSurface];
      if (const double range = range_m(surface, ray); range < nearest.range_m)
        nearest = {range, &surface, nullptr};
      continue;
    }
    const TreeNode& node = nodes_[next];
    TreeNode::Lanes enter = TreeNode::Lanes::Zero(),
                    leave = TreeNode::Lanes::Constant(static_cast<float>(nearest.range_m));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      const TreeNode::Lanes a = (node.min_m[axis] - origin[i]) * inverse[i];
      const TreeNode::Lanes b = (node.max_m[axis] - origin[i]) * inverse[i];
      enter = enter.max(a.min(b));
      leave = leave.min(a.max(b));
    }
    const std::size_t first_child = depth;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const auto j = static_cast<Eigen::Index>(lane);
      if (enter[j] > leave[j])
        continue;
      std::size_t place = depth++; // nearest on top: it often hides the others
      for (; place > first_child && waiting.enter_m[place - 1] < enter[j]; --place)
        put(place, waiting.child[place - 1], waiting.enter_m[place - 1]);
      put(place, node.child[lane], enter[j]);
    }
  }
}

void Scene::cast_at_movers(const Ray& ray, Stamp stamp, Met& nearest) const {
  const Eigen::Array3d inverse = ray.direction.array().inverse();
  for (std::size_t i = 0; i < movers_.size(); ++i) {
    if (!passes_through(ray.origin_m, inverse, mover_bounds_[i], nearest.range_m))
      continue;
    const Ray own{ray.origin_m - movers_[i].position_m(stamp), ray.direction};
    for (const Surface& part : movers_[i].parts) {
      const double range = range_m(part, own);
      if (range < nearest.range_m)
        nearest = {range, &part, &movers_[i]};
    }
  }
}

std::optional<Hit> Scene::cast_at_solid(const Ray& ray, double max_range_m, Stamp stamp, const Surface* guess) const {
  Met nearest{.range_m = max_range_m};
  if (guess != nullptr) {
    if (const double range = range_m(*guess, ray); range < max_range_m)
      nearest = {range, guess, nullptr};
  }
  cast_at_surfaces(ray, nearest);
  cast_at_movers(ray, stamp, nearest);
  std::optional<Passer::Met> passing;
  for (const Passer& passer : passers_) {
    if (const auto met = passer.met_by(ray, passing ? passing->range_m : nearest.range_m, stamp))
      passing = met;
  }
  if (passing)
    return Hit{ray.origin_m + passing->range_m * ray.direction,
               passing->range_m,
               std::abs(passing->normal.dot(ray.direction)),
               passing->reflectivity,
               nullptr,
               passing->normal};
  if (nearest.surface == nullptr)
    return std::nullopt;
  const Eigen::Vector3d point_m = ray.origin_m + nearest.range_m * ray.direction;
  const Eigen::Vector3d own_m = nearest.mover != nullptr ? point_m - nearest.mover->position_m(stamp) : point_m;
  const Eigen::Vector3d normal =
      std::visit([&](const auto& shape) { return shape.normal(own_m); }, nearest.surface->shape);
  return Hit{point_m,
             nearest.range_m,
             std::abs(normal.dot(ray.direction)),
             nearest.surface->reflectivity,
             nearest.mover == nullptr ? nearest.surface : nullptr,
             normal};
}

std::optional<Hit> Scene::through_steam(const Ray& ray, const std::optional<Hit>& solid, double max_range_m,
                                        Stamp stamp, QuickDice& dice) const {
  constexpr double kDimmest = 2, kBrightest = 8; // as for dust grains
  const auto echo_m = steam_.range_m(ray, solid ? solid->range_m : max_range_m, stamp, dice);
  if (!echo_m)
    return std::nullopt;
  const auto reflectivity = static_cast<std::uint8_t>(kDimmest + (kBrightest - kDimmest) * dice.uniform());
  return Hit{.point_m = ray.origin_m + *echo_m * ray.direction,
             .range_m = *echo_m,
             .cos_incidence = 1,
             .reflectivity = reflectivity,
             .surface = solid ? solid->surface : nullptr, // guess for the next ray, which may pass
             .normal = -ray.direction,
             .apparent = true};
}

std::optional<Hit> Scene::in_mirror(const Ray& ray, const Hit& solid, double max_range_m, Stamp stamp,
                                    QuickDice& dice) const {
  const auto cast = [&](const Ray& mirrored, double range_m) {
    return cast_at_solid(mirrored, range_m, stamp, nullptr);
  };
  if (mirrors_->is_wet(ray, solid))
    return Mirrors::on_water(ray, solid, max_range_m, dice.uniform(), cast);
  if (mirrors_->is_glass(solid, static_cast<std::size_t>(solid.surface - surfaces_.data())))
    return Mirrors::on_glass(ray, solid, max_range_m, dice.uniform(), cast);
  return solid;
}

std::optional<Hit> Scene::cast(const Ray& ray, double max_range_m, Stamp stamp, const Surface* guess) const {
  std::optional<Hit> solid = cast_at_solid(ray, max_range_m, stamp, guess);
  const bool may_mirror = mirrors_ && solid && solid->surface != nullptr;
  if (!may_mirror && steam_.clouds().empty())
    return solid;
  QuickDice dice = dice_of(ray, stamp);
  if (auto steam = through_steam(ray, solid, max_range_m, stamp, dice))
    return steam;
  return may_mirror ? in_mirror(ray, *solid, max_range_m, stamp, dice) : solid;
}

double Scene::distance_to_surface(const Eigen::Vector3d& point, Stamp stamp) const {
  double nearest = kNowhere;
  for (const Mover& mover : movers_) {
    for (const Surface& part : mover.parts)
      nearest = std::min(nearest, distance_m(part, point - mover.position_m(stamp)));
  }
  for (const Passer& passer : passers_)
    nearest = std::min(nearest, passer.distance_m(point, stamp));
  struct Near { // squared distance to the box of a child
    double squared_m2;
    std::uint32_t child;
  };
  std::vector<Near> waiting;
  if (!nodes_.empty())
    waiting.push_back({0, static_cast<std::uint32_t>(nodes_.size() - 1)});
  while (!waiting.empty()) {
    const Near next = waiting.back();
    waiting.pop_back();
    if (next.squared_m2 > nearest * nearest)
      continue;
    if ((next.child & kSurface) != 0) {
      nearest = std::min(nearest, distance_m(surfaces_[next.child - kSurface], point));
      continue;
    }
    const TreeNode& node = nodes_[next.child];
    for (std::size_t lane = 0; lane < 4; ++lane) {
      Bounds box;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<Eigen::Index>(axis), j = static_cast<Eigen::Index>(lane);
        box.min_m[i] = static_cast<double>(node.min_m[axis][j]);
        box.max_m[i] = static_cast<double>(node.max_m[axis][j]);
      }
      waiting.push_back({squared_distance(box, point), node.child[lane]});
    }
    std::sort(waiting.end() - 4, waiting.end(), // the nearest is visited first and prunes the others
              [](const Near& a, const Near& b) { return a.squared_m2 > b.squared_m2; });
  }
  return nearest;
}

} // namespace locus::sim
