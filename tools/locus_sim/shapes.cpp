// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/shapes.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace locus::sim {
namespace {

constexpr double kTouching_m = 1e-9; // a ray that starts on a surface does not hit it
constexpr double kSeam = 1e-9;       // tolerance of edges: no ray slips through between two triangles

/// Returns the smaller root of t^2 + 2 b t + c = 0 in front of the origin that `accepts`; infinity if there is none.
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

/// Entry and exit of a ray through an axis-aligned box; a miss if enter > leave.
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

/// Returns finite values even for a ray along an axis, to avoid 0 * infinity on the face of a box.
Eigen::Vector3d inverse(const Eigen::Vector3d& direction) {
  return direction.unaryExpr([](double d) { return 1.0 / (d == 0.0 ? 1e-300 : d); });
}

Eigen::Vector3d into_box(const Box& box, const Eigen::Vector3d& v) {
  return {box.cos_yaw * v.x() + box.sin_yaw * v.y(), box.cos_yaw * v.y() - box.sin_yaw * v.x(), v.z()};
}

} // namespace

Bounds united(const Bounds& a, const Bounds& b) { return {a.min_m.cwiseMin(b.min_m), a.max_m.cwiseMax(b.max_m)}; }

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

Eigen::Vector3d Rectangle::normal(const Eigen::Vector3d&) const { return edge_u_m.cross(edge_v_m).normalized(); }

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

double Triangle::range_m(const Ray& ray) const {
  const Eigen::Vector3d across = ray.direction.cross(edge_v_m);
  const double determinant = across.dot(edge_u_m);
  if (determinant == 0)
    return kNowhere;
  const double scale = 1 / determinant;
  const Eigen::Vector3d from_corner = ray.origin_m - corner_m;
  const double u = scale * from_corner.dot(across);
  const Eigen::Vector3d other = from_corner.cross(edge_u_m);
  const double v = scale * ray.direction.dot(other);
  if (u < -kSeam || v < -kSeam || u + v > 1 + kSeam)
    return kNowhere;
  const double t = scale * edge_v_m.dot(other);
  return t > kTouching_m ? t : kNowhere;
}

Eigen::Vector3d Triangle::normal(const Eigen::Vector3d&) const { return edge_u_m.cross(edge_v_m).normalized(); }

/// Returns the distance to the inside, else to the nearest edge.
double Triangle::distance_m(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_corner = point - corner_m, normal_m2 = edge_u_m.cross(edge_v_m);
  const double u = from_corner.cross(edge_v_m).dot(normal_m2) / normal_m2.squaredNorm();
  const double v = edge_u_m.cross(from_corner).dot(normal_m2) / normal_m2.squaredNorm();
  if (u >= 0 && v >= 0 && u + v <= 1)
    return std::abs(from_corner.dot(normal_m2.normalized()));
  const auto to_edge = [](const Eigen::Vector3d& from_begin, const Eigen::Vector3d& edge) {
    return (from_begin - std::clamp(from_begin.dot(edge) / edge.squaredNorm(), 0.0, 1.0) * edge).norm();
  };
  return std::min({to_edge(from_corner, edge_u_m), to_edge(from_corner, edge_v_m),
                   to_edge(from_corner - edge_u_m, edge_v_m - edge_u_m)});
}

Bounds Triangle::bounds() const {
  const Eigen::Vector3d u = corner_m + edge_u_m, v = corner_m + edge_v_m;
  return {corner_m.cwiseMin(u).cwiseMin(v), corner_m.cwiseMax(u).cwiseMax(v)};
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

Eigen::Vector3d Box::normal(const Eigen::Vector3d& point) const {
  Eigen::Index axis = 0;
  (into_box(*this, point - center_m).cwiseAbs() - half_size_m).maxCoeff(&axis);
  if (axis == 2)
    return Eigen::Vector3d::UnitZ();
  return axis == 0 ? Eigen::Vector3d{cos_yaw, sin_yaw, 0} : Eigen::Vector3d{-sin_yaw, cos_yaw, 0};
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
  const double along = axis.dot(ray.direction), begin = axis.dot(from_base);
  const double a = 1 - along * along; // squared component across the axis
  if (a < 1e-12)
    return kNowhere;
  const double b = (from_base.dot(ray.direction) - begin * along) / a;
  const double c = (from_base.squaredNorm() - begin * begin - radius_m * radius_m) / a;
  return first_root(b, c, [&](double t) {
    const double z = begin + t * along;
    return z >= 0 && z <= height_m;
  });
}

Eigen::Vector3d Cylinder::normal(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_base = point - base_m;
  return (from_base - axis.dot(from_base) * axis).normalized();
}

double Cylinder::distance_m(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_base = point - base_m;
  const double z = axis.dot(from_base);
  return std::hypot((from_base - z * axis).norm() - radius_m, z - std::clamp(z, 0.0, height_m));
}

Bounds Cylinder::bounds() const {
  const Eigen::Vector3d reach = radius_m * (1 - axis.array().square()).max(0.0).sqrt();
  return united({base_m - reach, base_m + reach}, {base_m + height_m * axis - reach, base_m + height_m * axis + reach});
}

double Sphere::range_m(const Ray& ray) const {
  const Eigen::Vector3d from_center = ray.origin_m - center_m;
  return first_root(from_center.dot(ray.direction), from_center.squaredNorm() - radius_m * radius_m,
                    [](double) { return true; });
}

Eigen::Vector3d Sphere::normal(const Eigen::Vector3d& point) const { return (point - center_m).normalized(); }

double Sphere::distance_m(const Eigen::Vector3d& point) const { return std::abs((point - center_m).norm() - radius_m); }

Bounds Sphere::bounds() const {
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius_m);
  return {center_m - reach, center_m + reach};
}

} // namespace locus::sim
