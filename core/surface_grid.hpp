// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/pose.hpp"

namespace locus {

/// Index of a voxel: 21 bits an axis, so 1000 km at half a metre.
struct VoxelIndex {
  std::int32_t x, y, z;
  friend bool operator==(const VoxelIndex&, const VoxelIndex&) = default;
};

/// What registration reads of a voxel: the plane through its points.
struct Surface {
  Eigen::Vector3f mean_m; ///< from the centre of its voxel
  Eigen::Vector3f normal; ///< unit
  float variance_m2;      ///< along the normal; negative: the points lie on no plane
  [[nodiscard]] bool planar() const { return variance_m2 > 0.0F; }
};

/// Running Gaussians of points in cubic voxels, found by hashing.
///
/// Each point brings its own covariance, a disc where its normal is known; a voxel's covariance is the moment match of
/// them all, so a plane shows with a single point that knows its normal as well as with many that do not. Voxels live
/// in a pool of fixed size; when it is full the oldest one far from the robot gives way. Nothing walks the whole map.
/// One writer or many readers.
class SurfaceGrid {
 public:
  SurfaceGrid(double leaf_m, std::size_t max_bytes);

  /// Adds a point; `normal` is unit or zero. Call refresh() before the surfaces are read again.
  void insert(const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal);
  /// Brings the surfaces of the voxels up to date that were written to since the last call.
  void refresh();
  void clear();
  /// Voxels nearer than `radius_m` to `centre_m` are spared from eviction.
  void protect(const Eigen::Vector3d& centre_m, double radius_m);

  [[nodiscard]] VoxelIndex index_of(const Eigen::Vector3d& point_m) const;
  [[nodiscard]] Eigen::Vector3d centre_of(VoxelIndex index) const;
  /// Nothing where no point has fallen.
  [[nodiscard]] const Surface* find(VoxelIndex index) const;

  [[nodiscard]] double leaf_m() const { return leaf_m_; }
  [[nodiscard]] std::size_t size() const { return used_; }
  [[nodiscard]] std::size_t capacity() const { return surfaces_.size(); }
  [[nodiscard]] std::uint64_t evicted() const { return evicted_; }
  /// Slots 0..size()-1, in no order that means anything.
  [[nodiscard]] const Surface& surface(std::size_t slot) const { return surfaces_[slot]; }
  [[nodiscard]] Eigen::Vector3d centre(std::size_t slot) const { return centre_of(voxels_[slot]); }

 private:
  static constexpr std::uint32_t kEmpty = 0xFFFFFFFFU;

  struct Entry {
    std::uint32_t tag = 0; ///< upper half of the hash: most foreign voxels are told apart without a look at the pool
    std::uint32_t slot = kEmpty;
  };

  struct Moments { ///< sums over points, relative to the centre of the voxel
    float count = 0.0F;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    Eigen::Matrix<float, 6, 1> outer = Eigen::Matrix<float, 6, 1>::Zero();      ///< xx xy xz yy yz zz of position
    Eigen::Matrix<float, 6, 1> covariance = Eigen::Matrix<float, 6, 1>::Zero(); ///< the points' own
    bool touched = false;
  };

  [[nodiscard]] std::size_t home_of(VoxelIndex index) const;
  [[nodiscard]] std::uint32_t slot_of(VoxelIndex index) const;
  std::uint32_t find_or_create(VoxelIndex index);
  std::uint32_t take_slot();
  void erase_entry(VoxelIndex index);
  [[nodiscard]] Surface fit(const Moments& moments) const;

  double leaf_m_;
  std::vector<Entry> entries_; ///< open addressing, linear probing, power of two, at most half full
  std::vector<VoxelIndex> voxels_;
  std::vector<Surface> surfaces_;
  std::vector<Moments> moments_;
  std::vector<std::uint32_t> touched_;
  std::size_t used_ = 0;
  std::size_t hand_ = 0; ///< next slot to be considered for eviction
  std::uint64_t evicted_ = 0;
  Eigen::Vector3d protected_centre_m_ = Eigen::Vector3d::Zero();
  double protected_radius_m_ = 0.0;
};

} // namespace locus
