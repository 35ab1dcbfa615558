// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Records the origins of echoes in cubes of half a metre: the true map contains only observed space, no hidden sides.
/// One owner.
class ObservedSpace {
 public:
  /// Ignores points outside the bounds.
  explicit ObservedSpace(const Bounds& bounds)
      : origin_m_(bounds.min_m.array() - kCube_m),
        size_(((bounds.max_m - origin_m_) / kCube_m).array().ceil().cast<std::ptrdiff_t>() + 1),
        observed_(static_cast<std::size_t>(size_.prod())) {}

  void mark(const Eigen::Vector3d& point) {
    const Cube cube = cube_of(point);
    if (contains(cube))
      observed_[index(cube)] = true;
  }

  [[nodiscard]] bool holds(const Eigen::Vector3d& point) const {
    const Cube cube = cube_of(point);
    return contains(cube) && observed_[index(cube)];
  }

  /// Returns whether there is any such cube within bounds, or at their edge.
  [[nodiscard]] bool reaches_into(const Bounds& bounds) const {
    const Cube first = cube_of(bounds.min_m).max(0), last = cube_of(bounds.max_m).min(size_ - 1);
    for (std::ptrdiff_t z = first.z(); z <= last.z(); ++z)
      for (std::ptrdiff_t y = first.y(); y <= last.y(); ++y)
        for (std::ptrdiff_t x = first.x(); x <= last.x(); ++x)
          if (observed_[index({x, y, z})])
            return true;
    return false;
  }

 private:
  static constexpr double kCube_m = 0.5;
  using Cube = Eigen::Array<std::ptrdiff_t, 3, 1>;

  [[nodiscard]] Cube cube_of(const Eigen::Vector3d& point) const {
    return ((point - origin_m_) / kCube_m).array().floor().cast<std::ptrdiff_t>();
  }
  [[nodiscard]] bool contains(const Cube& cube) const { return (cube >= 0).all() && (cube < size_).all(); }
  [[nodiscard]] std::size_t index(const Cube& cube) const {
    return static_cast<std::size_t>((cube.z() * size_.y() + cube.y()) * size_.x() + cube.x());
  }

  Eigen::Vector3d origin_m_;
  Cube size_;
  std::vector<bool> observed_;
};

} // namespace locus::sim
