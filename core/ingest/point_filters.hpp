// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "core/base/options.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Replaces the points of each voxel by their mean (paper II-A, 3D voxel grid). The means are in the order of the first
/// points of their voxels, so the result depends on the sweep alone. One owner.
class VoxelFilter {
 public:
  VoxelFilter(const VoxelFilterOptions& options, std::size_t max_points);
  void apply(std::vector<SweepPoint>& points);

 private:
  struct Keyed {
    std::uint64_t voxel;
    std::uint32_t point;
  };
  double leaf_m_;
  std::vector<Keyed> keyed_;
  std::vector<SweepPoint> means_;
};

/// Retains a random share of the points, each with equal probability, in their order (paper II-A: random downsampling
/// after Vitter 1984; here selection sampling, which retains exactly the requested share). Seeded: same points, same
/// selection. One owner.
class RandomFilter {
 public:
  RandomFilter(const RandomFilterOptions& options, std::uint64_t seed) : keep_(options.keep), random_(seed) {}
  void apply(std::vector<SweepPoint>& points);

 private:
  double keep_;
  std::mt19937_64 random_;
};

} // namespace locus
