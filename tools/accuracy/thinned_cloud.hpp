// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace locus {

/// Voxel centroids of a cloud of any size. The voxel side doubles whenever there are too many. One owner.
class ThinnedCloud {
 public:
  ThinnedCloud(float side_m, std::size_t max_voxels) : side_m_(side_m), max_voxels_(max_voxels) {}

  void insert(const Eigen::Vector3f& position);

  [[nodiscard]] std::vector<Eigen::Vector3f> centroids() const;
  [[nodiscard]] float side_m() const { return side_m_; }

 private:
  struct Voxel {
    Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
    std::uint64_t points = 0;

    [[nodiscard]] Eigen::Vector3f centroid() const { return (sum_m / static_cast<double>(points)).cast<float>(); }
  };

  void coarsen();

  float side_m_;
  std::size_t max_voxels_;
  std::unordered_map<std::uint64_t, Voxel> voxels_;
};

} // namespace locus
