// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "core/base/options.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Replaces the points of each voxel by their mean (paper II-A, 3D voxel grid). The order of the survivors is that of
/// their voxels' first points, so it depends on the sweep alone. One owner.
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

/// Keeps a share of the points, each as likely as any other, in their order (paper II-A: random downsampling after
/// Vitter 1984; here by selection sampling, which keeps exactly the share asked for). Seeded: same points, same choice.
/// One owner.
class RandomFilter {
 public:
  RandomFilter(const RandomFilterOptions& options, std::uint64_t seed) : keep_(options.keep), random_(seed) {}
  void apply(std::vector<SweepPoint>& points);

 private:
  double keep_;
  std::mt19937_64 random_;
};

} // namespace locus
