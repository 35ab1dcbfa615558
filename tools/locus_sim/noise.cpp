// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/noise.hpp"

#include "locus_sim/jet.hpp"

namespace locus::sim {

/// Evaluates value noise: random values at the corners of a lattice, interpolated in between.
double Noise::operator()(const Eigen::Vector3d& point) const {
  const Eigen::Array3d floor = point.array().floor();
  const Eigen::Array<std::int64_t, 3, 1> corner = floor.cast<std::int64_t>();
  const Eigen::Array3d share = (point.array() - floor).unaryExpr([](double u) { return ease(u); });
  double sum = 0;
  for (std::int64_t i = 0; i < 8; ++i) {
    const std::int64_t dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
    const double weight = (dx != 0 ? share.x() : 1 - share.x()) * (dy != 0 ? share.y() : 1 - share.y()) *
                          (dz != 0 ? share.z() : 1 - share.z());
    sum += weight * at_lattice(corner.x() + dx, corner.y() + dy, corner.z() + dz);
  }
  return sum;
}

/// Hashes by multiplication with large odd numbers, and shifts that mix the high bits down.
double Noise::at_lattice(std::int64_t x, std::int64_t y, std::int64_t z) const {
  std::uint64_t bits = seed_;
  for (const std::int64_t coordinate : {x, y, z}) {
    bits = (bits ^ static_cast<std::uint64_t>(coordinate)) * 0x9E37'79B9'7F4A'7C15U;
    bits ^= bits >> 29;
  }
  bits *= 0xD6E8'FEB8'6659'FD93U;
  return static_cast<double>(bits >> 11) * 0x1p-52 - 1;
}

} // namespace locus::sim
