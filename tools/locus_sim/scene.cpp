// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace locus::sim {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::infinity();
constexpr double kTouching_m = 1e-9; // a ray that starts on a surface leaves it
constexpr std::uint32_t kLeafSize = 2;
constexpr std::size_t kMaxDepth = 64;

/// Smaller root of t^2 + 2 b t + c = 0 in front of the origin that `accepts`, infinity when there is none.
template <class Accepts> double first_root(double b, double c, Accepts accepts) {
  const double discriminant = b * b - c;
  if (discriminant < 0)
    return kNowhere;
  const double root = std::sqrt(discriminant);
  for (const double t : {-b - root, -b + root})
    if (t > kTouching_m && accepts(t))
      return t;
  return kNowhere;
}

/// Where a ray enters and leaves an axis-aligned box; it misses when enter > leave.
struct Passage {
  double enter, leave;
};

Passage passage(const Bounds& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& inverse_direction) {
  Passage through{-kNowhere, kNowhere};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double a = (box.min_m[axis] - origin[axis]) * inverse_direction[axis];
    const double b = (box.max_m[axis] - origin[axis]) * inverse_direction[axis];
    through.enter = std::max(through.enter, std::min(a, b));
    through.leave = std::min(through.leave, std::max(a, b));
  }
  return through;
}

/// Finite even where the ray runs along an axis, so that no 0 * infinity arises on the face of a box.
Eigen::Vector3d inverse(const Eigen::Vector3d& direction) {
  return direction.unaryExpr([](double d) { return 1.0 / (d == 0.0 ? 1e-300 : d); });
}

double squared_distance(const Bounds& box, const Eigen::Vector3d& point) {
  return (point - point.cwiseMax(box.min_m).cwiseMin(box.max_m)).squaredNorm();
}

Bounds united(const Bounds& a, const Bounds& b) { return {a.min_m.cwiseMin(b.min_m), a.max_m.cwiseMax(b.max_m)}; }

Bounds bounds_of(const Surface& surface) {
  return std::visit([](const auto& shape) { return shape.bounds(); }, surface.shape);
}

Eigen::Vector3d into_box(const Box& box, const Eigen::Vector3d& v) {
  return {box.cos_yaw * v.x() + box.sin_yaw * v.y(), box.cos_yaw * v.y() - box.sin_yaw * v.x(), v.z()};
}

} // namespace

double Rectangle::range_m(const Ray& ray) const {
  const Eigen::Vector3d normal = edge_u_m.cross(edge_v_m);
  const double approach = normal.dot(ray.direction);
  if (approach == 0)
    return kNowhere;
  const double t = normal.dot(corner_m - ray.origin_m) / approach;
  if (!(t > kTouching_m))
    return kNowhere;
  const Eigen::Vector3d from_corner = ray.origin_m + t * ray.direction - corner_m;
  const double u = from_corner.dot(edge_u_m), v = from_corner.dot(edge_v_m);
  const bool inside = u >= 0 && u <= edge_u_m.squaredNorm() && v >= 0 && v <= edge_v_m.squaredNorm();
  return inside ? t : kNowhere;
}

double Rectangle::distance_m(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_corner = point - corner_m;
  const double u = std::clamp(from_corner.dot(edge_u_m) / edge_u_m.squaredNorm(), 0.0, 1.0);
  const double v = std::clamp(from_corner.dot(edge_v_m) / edge_v_m.squaredNorm(), 0.0, 1.0);
  return (from_corner - u * edge_u_m - v * edge_v_m).norm();
}

Bounds Rectangle::bounds() const {
  const Eigen::Vector3d u = corner_m + edge_u_m, v = corner_m + edge_v_m;
  return united({corner_m.cwiseMin(u), corner_m.cwiseMax(u)}, {v.cwiseMin(v + edge_u_m), v.cwiseMax(v + edge_u_m)});
}

double Box::range_m(const Ray& ray) const {
  const Passage through = passage({-half_size_m, half_size_m}, into_box(*this, ray.origin_m - center_m),
                                  inverse(into_box(*this, ray.direction)));
  if (through.enter > through.leave)
    return kNowhere;
  if (through.enter > kTouching_m)
    return through.enter;
  return through.leave > kTouching_m ? through.leave : kNowhere;
}

double Box::distance_m(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d beyond = into_box(*this, point - center_m).cwiseAbs() - half_size_m;
  const double inside = beyond.maxCoeff();
  return inside < 0 ? -inside : beyond.cwiseMax(0.0).norm();
}

Bounds Box::bounds() const {
  const double c = std::abs(cos_yaw), s = std::abs(sin_yaw);
  const Eigen::Vector3d reach{c * half_size_m.x() + s * half_size_m.y(), s * half_size_m.x() + c * half_size_m.y(),
                              half_size_m.z()};
  return {center_m - reach, center_m + reach};
}

double Cylinder::range_m(const Ray& ray) const {
  const Eigen::Vector3d from_base = ray.origin_m - base_m;
  const double a = ray.direction.head<2>().squaredNorm();
  if (a == 0)
    return kNowhere;
  const double b = from_base.head<2>().dot(ray.direction.head<2>()) / a;
  const double c = (from_base.head<2>().squaredNorm() - radius_m * radius_m) / a;
  return first_root(b, c, [&](double t) {
    const double z = from_base.z() + t * ray.direction.z();
    return z >= 0 && z <= height_m;
  });
}

double Cylinder::distance_m(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_base = point - base_m;
  const double radially = from_base.head<2>().norm() - radius_m;
  const double along = from_base.z() - std::clamp(from_base.z(), 0.0, height_m);
  return std::hypot(radially, along);
}

Bounds Cylinder::bounds() const {
  const Eigen::Vector3d reach{radius_m, radius_m, 0};
  return {base_m - reach, base_m + reach + Eigen::Vector3d{0, 0, height_m}};
}

double Sphere::range_m(const Ray& ray) const {
  const Eigen::Vector3d from_center = ray.origin_m - center_m;
  return first_root(from_center.dot(ray.direction), from_center.squaredNorm() - radius_m * radius_m,
                    [](double) { return true; });
}

double Sphere::distance_m(const Eigen::Vector3d& point) const { return std::abs((point - center_m).norm() - radius_m); }

Bounds Sphere::bounds() const {
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius_m);
  return {center_m - reach, center_m + reach};
}

Scene::Scene(std::vector<Surface> surfaces) : surfaces_(std::move(surfaces)) {
  nodes_.reserve(2 * surfaces_.size());
  if (!surfaces_.empty())
    build(0, static_cast<std::uint32_t>(surfaces_.size()));
}

void Scene::build(std::uint32_t begin, std::uint32_t end) {
  const auto first = surfaces_.begin() + begin, last = surfaces_.begin() + end;
  Bounds bounds = bounds_of(*first);
  std::for_each(first, last, [&](const Surface& surface) { bounds = united(bounds, bounds_of(surface)); });
  if (end - begin <= kLeafSize) {
    nodes_.push_back({bounds, begin, static_cast<std::uint16_t>(end - begin), 0});
    return;
  }

  Eigen::Index axis = 0;
  (bounds.max_m - bounds.min_m).maxCoeff(&axis);
  const auto middle = first + (end - begin) / 2;
  std::nth_element(first, middle, last, [axis](const Surface& a, const Surface& b) {
    const Bounds of_a = bounds_of(a), of_b = bounds_of(b);
    return of_a.min_m[axis] + of_a.max_m[axis] < of_b.min_m[axis] + of_b.max_m[axis];
  });
  const auto split = static_cast<std::uint32_t>(middle - surfaces_.begin());
  const std::size_t node = nodes_.size();
  nodes_.push_back({bounds, 0, 0, static_cast<std::uint16_t>(axis)});
  build(begin, split);
  nodes_[node].first = static_cast<std::uint32_t>(nodes_.size());
  build(split, end);
}

std::optional<Hit> Scene::cast(const Ray& ray, double max_range_m) const {
  const Eigen::Vector3d inverse_direction = inverse(ray.direction);
  double nearest = max_range_m;
  const Surface* met = nullptr;
  std::array<std::uint32_t, kMaxDepth> waiting;
  std::size_t depth = 0;
  if (!nodes_.empty())
    waiting[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t index = waiting[--depth];
    const Node& node = nodes_[index];
    const Passage through = passage(node.bounds, ray.origin_m, inverse_direction);
    if (through.enter > through.leave || through.leave < 0 || through.enter > nearest)
      continue;
    if (node.count == 0) { // the nearer child is looked at first: what it holds often hides the other
      const bool forward = ray.direction[node.axis] > 0;
      waiting[depth++] = forward ? node.first : index + 1;
      waiting[depth++] = forward ? index + 1 : node.first;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const double range_m = std::visit([&](const auto& shape) { return shape.range_m(ray); }, surfaces_[i].shape);
      if (range_m < nearest) {
        nearest = range_m;
        met = &surfaces_[i];
      }
    }
  }
  return met ? std::optional<Hit>{{nearest, met->reflectivity}} : std::nullopt;
}

double Scene::distance_to_surface(const Eigen::Vector3d& point) const {
  double nearest = kNowhere;
  std::array<std::uint32_t, kMaxDepth> waiting;
  std::size_t depth = 0;
  if (!nodes_.empty())
    waiting[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t index = waiting[--depth];
    const Node& node = nodes_[index];
    if (squared_distance(node.bounds, point) > nearest * nearest)
      continue;
    if (node.count == 0) {
      waiting[depth++] = node.first;
      waiting[depth++] = index + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
      nearest =
          std::min(nearest, std::visit([&](const auto& shape) { return shape.distance_m(point); }, surfaces_[i].shape));
  }
  return nearest;
}

} // namespace locus::sim
