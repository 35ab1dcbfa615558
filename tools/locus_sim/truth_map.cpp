// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/truth_map.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <span>

namespace locus::sim {
namespace {

constexpr double kStep_m = 0.03;
static_assert(std::endian::native == std::endian::little, "points are written as they lie in memory");

int steps(double length_m) { return std::max(1, static_cast<int>(std::ceil(length_m / kStep_m))); }

/// Samples points of a shape, at most a step apart in both directions, into a sink.
template <class Sink> class Sampler {
 public:
  explicit Sampler(Sink& sink) : sink_(sink) {}

  void operator()(const Rectangle& shape) const { patch(shape.corner_m, shape.edge_u_m, shape.edge_v_m, 2); }
  void operator()(const Triangle& shape) const { patch(shape.corner_m, shape.edge_u_m, shape.edge_v_m, 1); }
  void operator()(const Box& box) const {
    Eigen::Matrix3d axes;
    axes << box.cos_yaw, -box.sin_yaw, 0, box.sin_yaw, box.cos_yaw, 0, 0, 0, 1;
    axes *= box.half_size_m.asDiagonal();
    for (const Eigen::Index axis : {0, 1, 2}) {
      const Eigen::Vector3d out = axes.col(axis), u = axes.col((axis + 1) % 3), v = axes.col((axis + 2) % 3);
      for (const double side : {-1.0, 1.0})
        patch(box.center_m + side * out - u - v, 2 * u, 2 * v, 2);
    }
  }
  void operator()(const Cylinder& shape) const {
    ring(shape.base_m, shape.axis, shape.radius_m, shape.height_m * shape.axis);
  }
  void operator()(const Sphere& shape) const {
    const int rings = steps(std::numbers::pi * shape.radius_m);
    for (int i = 0; i <= rings; ++i) {
      const double angle = std::numbers::pi * i / rings;
      const Eigen::Vector3d up{0, 0, shape.radius_m * std::cos(angle)};
      ring(shape.center_m + up, Eigen::Vector3d::UnitZ(), shape.radius_m * std::sin(angle), Eigen::Vector3d::Zero());
    }
  }

 private:
  /// Samples a parallelogram where the shares of both edges sum to at most `sum`.
  void patch(const Eigen::Vector3d& corner, const Eigen::Vector3d& u, const Eigen::Vector3d& v, double sum) const {
    const int along = steps(u.norm()), across = steps(v.norm());
    for (int i = 0; i <= along; ++i) {
      const double share = static_cast<double>(i) / along;
      const Eigen::Vector3d begin = corner + share * u;
      for (int j = 0; j <= across && share + static_cast<double>(j) / across <= sum + 1e-9; ++j)
        sink_(begin + static_cast<double>(j) / across * v);
    }
  }
  /// Samples a circle about an axis, extruded along `way`.
  void ring(const Eigen::Vector3d& center, const Eigen::Vector3d& axis, double radius,
            const Eigen::Vector3d& way) const {
    const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
    const int around = steps(2 * std::numbers::pi * radius), along = steps(way.norm());
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      const Eigen::Vector3d begin = center + radius * (std::cos(angle) * u + std::sin(angle) * v);
      for (int j = 0; j <= along; ++j)
        sink_(begin + static_cast<double>(j) / along * way);
    }
  }

  Sink& sink_;
};

template <class Sink> void for_each_point(const Scene& scene, const ObservedSpace& observed, Sink sink) {
  auto if_seen = [&](const Eigen::Vector3d& point) {
    if (observed.holds(point))
      sink(point);
  };
  const Sampler sampler(if_seen);
  for (const Surface& surface : scene.surfaces()) {
    if (observed.reaches_into(std::visit([](const auto& shape) { return shape.bounds(); }, surface.shape)))
      std::visit(sampler, surface.shape);
  }
}

} // namespace

void write_truth_map(tools::OutputFile& file, const Scene& scene, const ObservedSpace& observed) {
  const auto write_header = [&](std::size_t points) {
    file.print("ply\nformat binary_little_endian 1.0\nelement vertex {:12}\nproperty float x\nproperty float y\n"
               "property float z\nend_header\n",
               points);
  };
  std::size_t points = 0;
  write_header(points); // placeholder, overwritten when the number is known
  for_each_point(scene, observed, [&](const Eigen::Vector3d& point) {
    const Eigen::Vector3f single = point.cast<float>();
    file.write(std::as_bytes(std::span(single.data(), 3)));
    ++points;
  });
  file.rewind();
  write_header(points);
  file.close();
}

} // namespace locus::sim
