// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>

namespace locus::sim {

/// Smooth random function of space, -1..1, with features of about one metre: rock, turf. Deterministic in the seed.
/// Immutable, any thread.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : seed_(seed) {}

  [[nodiscard]] double operator()(const Eigen::Vector3d& point) const;

 private:
  [[nodiscard]] double at_lattice(std::int64_t x, std::int64_t y, std::int64_t z) const;

  std::uint64_t seed_;
};

} // namespace locus::sim
