// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/surface_net.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace locus::sim {
namespace {

/// Samples the function on a lattice.
class Lattice {
 public:
  using Index = Eigen::Array<std::ptrdiff_t, 3, 1>;

  Lattice(const Bounds& bounds, double cell_m, const std::function<double(const Eigen::Vector3d&)>& air)
      : origin_m_(bounds.min_m), cell_m_(cell_m),
        size_(((bounds.max_m - bounds.min_m) / cell_m).array().ceil().cast<std::ptrdiff_t>() + 1),
        air_(static_cast<std::size_t>(size_.prod())) {
    for (std::ptrdiff_t x = 0; x < size_.x(); ++x)
      for (std::ptrdiff_t y = 0; y < size_.y(); ++y)
        for (std::ptrdiff_t z = 0; z < size_.z(); ++z)
          air_[flat({x, y, z})] = static_cast<float>(air(place_m({x, y, z})));
  }

  [[nodiscard]] const Index& size() const { return size_; }
  [[nodiscard]] double at(const Index& index) const { return static_cast<double>(air_[flat(index)]); }
  [[nodiscard]] Eigen::Vector3d place_m(const Index& index) const {
    return origin_m_ + cell_m_ * index.cast<double>().matrix();
  }
  [[nodiscard]] bool crossed(const Index& a, const Index& b) const { return (at(a) > 0) != (at(b) > 0); }

  /// Returns the vertex of a cell, given by its lowest corner.
  [[nodiscard]] Eigen::Vector3d vertex_m(const Index& cell) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int crossings = 0;
    for (std::ptrdiff_t axis = 0; axis < 3; ++axis) {
      for (std::ptrdiff_t edge = 0; edge < 4; ++edge) {
        Index a = cell;
        a[(axis + 1) % 3] += edge & 1;
        a[(axis + 2) % 3] += edge >> 1;
        Index b = a;
        ++b[axis];
        if (!crossed(a, b))
          continue;
        const double share = at(a) / (at(a) - at(b));
        sum += place_m(a) + share * (place_m(b) - place_m(a));
        ++crossings;
      }
    }
    return sum / crossings;
  }

 private:
  [[nodiscard]] std::size_t flat(const Index& index) const {
    return static_cast<std::size_t>((index.x() * size_.y() + index.y()) * size_.z() + index.z());
  }

  Eigen::Vector3d origin_m_;
  double cell_m_;
  Index size_;
  std::vector<float> air_;
};

} // namespace

void add_surface(SceneBuilder& build, const Bounds& bounds, double cell_m,
                 const std::function<double(const Eigen::Vector3d&)>& air, std::uint8_t bright) {
  const Lattice lattice(bounds, cell_m, air);
  const auto add_about_edge = [&](const Lattice::Index& begin, std::ptrdiff_t axis) {
    Lattice::Index end = begin;
    ++end[axis];
    if (!lattice.crossed(begin, end))
      return;
    Lattice::Index u = Lattice::Index::Zero(), v = Lattice::Index::Zero();
    u[(axis + 1) % 3] = v[(axis + 2) % 3] = 1;
    const std::array<Eigen::Vector3d, 4> around{lattice.vertex_m(begin), lattice.vertex_m(begin - u),
                                                lattice.vertex_m(begin - u - v), lattice.vertex_m(begin - v)};
    build.triangle(around[0], around[1], around[2], bright);
    build.triangle(around[0], around[2], around[3], bright);
  };
  const Lattice::Index last = lattice.size() - 1;
  for (std::ptrdiff_t x = 1; x < last.x(); ++x)
    for (std::ptrdiff_t y = 1; y < last.y(); ++y)
      for (std::ptrdiff_t z = 1; z < last.z(); ++z)
        for (std::ptrdiff_t axis = 0; axis < 3; ++axis)
          add_about_edge({x, y, z}, axis);
}

} // namespace locus::sim
