// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

namespace locus::sim {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::infinity();
constexpr double kFar_m = 1e30; // where no ray comes
constexpr std::size_t kLeafSize = 4;
constexpr std::uint32_t kBranch = 0xFFFF'FFFF; // in place of the count of a leaf
constexpr std::size_t kStackSize = 256;        // three more per level
constexpr float kSlack_m = 1e-3F;              // boxes are larger by this: more than single precision can be wrong by

struct Waiting { // to be looked into, unless something nearer has been found
  std::uint32_t first, count;
  float enter_m;
};

Bounds bounds_of(const Surface& surface) {
  return std::visit([](const auto& shape) { return shape.bounds(); }, surface.shape);
}

Bounds bounds_of(std::span<const Surface> surfaces) {
  if (surfaces.empty())
    return {Eigen::Vector3d::Constant(kFar_m), Eigen::Vector3d::Constant(kFar_m)};
  Bounds all = bounds_of(surfaces.front());
  for (const Surface& surface : surfaces)
    all = united(all, bounds_of(surface));
  return all;
}

double area_m2(const Bounds& bounds) {
  const Eigen::Vector3d size = bounds.max_m - bounds.min_m;
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

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

} // namespace

Eigen::Vector3d Mover::position_m(Stamp stamp) const {
  const double turns = std::fmod(to_seconds(stamp.time_since_epoch()), period_s) / period_s + phase;
  return from_m + 0.5 * (1 - std::cos(2 * std::numbers::pi * turns)) * (to_m - from_m);
}

Bounds Mover::bounds() const {
  const Bounds own = bounds_of(parts);
  return united({own.min_m + from_m, own.max_m + from_m}, {own.min_m + to_m, own.max_m + to_m});
}

/// Sorts surfaces into a tree.
class Scene::TreeMaker {
 public:
  TreeMaker(std::vector<Surface>& surfaces, std::vector<Node>& nodes) : surfaces_(surfaces), nodes_(nodes) {
    for (const Surface& surface : surfaces) {
      order_.push_back(static_cast<std::uint32_t>(order_.size()));
      bounds_.push_back(bounds_of(surface));
    }
    area_behind_m2_.resize(surfaces.size());
  }

  void make() {
    if (!surfaces_.empty())
      node_over(0, order_.size());
    std::vector<Surface> sorted;
    std::transform(order_.begin(), order_.end(), std::back_inserter(sorted),
                   [&](std::uint32_t i) { return surfaces_[i]; });
    surfaces_ = std::move(sorted);
  }

 private:
  std::uint32_t node_over(std::size_t begin, std::size_t end) {
    const std::size_t middle = split(begin, end);
    const std::array<std::size_t, 5> limits{begin, split(begin, middle), middle, split(middle, end), end};
    Node node;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const std::size_t from = limits[lane], to = limits[lane + 1];
      const Bounds box = bounds_over(from, to);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<Eigen::Index>(axis), j = static_cast<Eigen::Index>(lane);
        node.min_m[axis][j] = static_cast<float>(box.min_m[i]) - kSlack_m;
        node.max_m[axis][j] = static_cast<float>(box.max_m[i]) + kSlack_m;
      }
      const bool is_leaf = to - from <= kLeafSize;
      node.first[lane] = is_leaf ? static_cast<std::uint32_t>(from) : node_over(from, to);
      node.count[lane] = is_leaf ? static_cast<std::uint32_t>(to - from) : kBranch;
    }
    nodes_.push_back(node);
    return static_cast<std::uint32_t>(nodes_.size() - 1);
  }

  [[nodiscard]] const Bounds& bounds(std::size_t place) const { return bounds_[order_[place]]; }

  [[nodiscard]] Bounds bounds_over(std::size_t begin, std::size_t end) const {
    if (begin == end)
      return {Eigen::Vector3d::Constant(kFar_m), Eigen::Vector3d::Constant(kFar_m)};
    Bounds all = bounds(begin);
    for (std::size_t i = begin + 1; i < end; ++i)
      all = united(all, bounds(i));
    return all;
  }

  /// Puts a range in order along its longest side and finds where to part it: where fewest surfaces are met, the chance
  /// to meet a box being as its area.
  std::size_t split(std::size_t begin, std::size_t end) {
    if (end - begin < 2)
      return end;
    const auto middle_of = [](const Bounds& box) -> Eigen::Vector3d { return box.min_m + box.max_m; };
    Bounds middles{middle_of(bounds(begin)), middle_of(bounds(begin))};
    for (std::size_t i = begin; i < end; ++i)
      middles = united(middles, {middle_of(bounds(i)), middle_of(bounds(i))});
    Eigen::Index axis = 0;
    (middles.max_m - middles.min_m).maxCoeff(&axis);
    const auto at = [&](std::size_t place) { return order_.begin() + static_cast<std::ptrdiff_t>(place); };
    std::stable_sort(at(begin), at(end), [&](std::uint32_t a, std::uint32_t b) {
      return middle_of(bounds_[a])[axis] < middle_of(bounds_[b])[axis];
    });
    return cheapest_cut(begin, end);
  }

  std::size_t cheapest_cut(std::size_t begin, std::size_t end) {
    Bounds box = bounds(end - 1);
    for (std::size_t i = end; i-- > begin;) {
      box = united(box, bounds(i));
      area_behind_m2_[i] = area_m2(box);
    }
    box = bounds(begin);
    double least = kNowhere;
    std::size_t best = begin + 1;
    for (std::size_t i = begin + 1; i < end; ++i) {
      box = united(box, bounds(i - 1));
      const double cost =
          area_m2(box) * static_cast<double>(i - begin) + area_behind_m2_[i] * static_cast<double>(end - i);
      if (cost < least) {
        least = cost;
        best = i;
      }
    }
    return best;
  }

  std::vector<Surface>& surfaces_;
  std::vector<Node>& nodes_;
  std::vector<std::uint32_t> order_;
  std::vector<Bounds> bounds_; ///< of the surfaces as they came
  std::vector<double> area_behind_m2_;
};

Scene::Scene(std::vector<Surface> surfaces, std::vector<Mover> movers)
    : surfaces_(std::move(surfaces)), movers_(std::move(movers)), bounds_(bounds_of(surfaces_)) {
  TreeMaker(surfaces_, nodes_).make();
  std::transform(movers_.begin(), movers_.end(), std::back_inserter(mover_bounds_),
                 [](const Mover& mover) { return mover.bounds(); });
}

void Scene::cast_at_surfaces(const Ray& ray, Met& nearest) const {
  const Eigen::Array3f origin = ray.origin_m.cast<float>();
  const Eigen::Array3f inverse =
      ray.direction.cast<float>().array().unaryExpr([](float d) { return 1.0F / (d == 0.0F ? 1e-30F : d); });
  std::array<Waiting, kStackSize> waiting;
  std::size_t depth = 0;
  if (!nodes_.empty())
    waiting[depth++] = {static_cast<std::uint32_t>(nodes_.size() - 1), kBranch, 0};
  while (depth > 0) {
    const Waiting next = waiting[--depth];
    if (next.enter_m > static_cast<float>(nearest.range_m))
      continue;
    if (next.count != kBranch) {
      for (std::uint32_t i = next.first; i < next.first + next.count; ++i) {
        const double range = range_m(surfaces_[i], ray);
        if (range < nearest.range_m)
          nearest = {range, &surfaces_[i], nullptr};
      }
      continue;
    }
    const Node& node = nodes_[next.first];
    Node::Lanes enter = Node::Lanes::Zero(), leave = Node::Lanes::Constant(static_cast<float>(nearest.range_m));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      const Node::Lanes a = (node.min_m[axis] - origin[i]) * inverse[i];
      const Node::Lanes b = (node.max_m[axis] - origin[i]) * inverse[i];
      enter = enter.max(a.min(b));
      leave = leave.min(a.max(b));
    }
    const std::size_t first_child = depth;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const auto j = static_cast<Eigen::Index>(lane);
      if (enter[j] > leave[j])
        continue;
      std::size_t place = depth++; // the nearest on top: what it holds often hides the others
      for (; place > first_child && waiting[place - 1].enter_m < enter[j]; --place)
        waiting[place] = waiting[place - 1];
      waiting[place] = {node.first[lane], node.count[lane], enter[j]};
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

std::optional<Hit> Scene::cast(const Ray& ray, double max_range_m, Stamp stamp, const Surface* guess) const {
  Met nearest{.range_m = max_range_m};
  if (guess != nullptr) {
    if (const double range = range_m(*guess, ray); range < max_range_m)
      nearest = {range, guess, nullptr};
  }
  cast_at_surfaces(ray, nearest);
  cast_at_movers(ray, stamp, nearest);
  if (nearest.surface == nullptr)
    return std::nullopt;
  const Eigen::Vector3d point_m = ray.origin_m + nearest.range_m * ray.direction;
  const Eigen::Vector3d own_m = nearest.mover != nullptr ? point_m - nearest.mover->position_m(stamp) : point_m;
  const Eigen::Vector3d normal =
      std::visit([&](const auto& shape) { return shape.normal(own_m); }, nearest.surface->shape);
  return Hit{point_m, nearest.range_m, std::abs(normal.dot(ray.direction)), nearest.surface->reflectivity,
             nearest.mover == nullptr ? nearest.surface : nullptr};
}

double Scene::distance_to_surface(const Eigen::Vector3d& point, Stamp stamp) const {
  double nearest = kNowhere;
  for (const Mover& mover : movers_) {
    for (const Surface& part : mover.parts)
      nearest = std::min(nearest, distance_m(part, point - mover.position_m(stamp)));
  }
  struct Near { // a node or a leaf, and the squared distance to its box
    double squared_m2;
    std::uint32_t first, count;
  };
  std::vector<Near> waiting;
  if (!nodes_.empty())
    waiting.push_back({0, static_cast<std::uint32_t>(nodes_.size() - 1), kBranch});
  while (!waiting.empty()) {
    const Near next = waiting.back();
    waiting.pop_back();
    if (next.squared_m2 > nearest * nearest)
      continue;
    if (next.count != kBranch) {
      for (std::uint32_t i = next.first; i < next.first + next.count; ++i)
        nearest = std::min(nearest, distance_m(surfaces_[i], point));
      continue;
    }
    const Node& node = nodes_[next.first];
    for (std::size_t lane = 0; lane < 4; ++lane) {
      Bounds box;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<Eigen::Index>(axis), j = static_cast<Eigen::Index>(lane);
        box.min_m[i] = static_cast<double>(node.min_m[axis][j]);
        box.max_m[i] = static_cast<double>(node.max_m[axis][j]);
      }
      waiting.push_back({squared_distance(box, point), node.first[lane], node.count[lane]});
    }
    std::sort(waiting.end() - 4, waiting.end(), // the nearest is looked at first and rules the others out
              [](const Near& a, const Near& b) { return a.squared_m2 > b.squared_m2; });
  }
  return nearest;
}

} // namespace locus::sim
