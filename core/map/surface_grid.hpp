// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/base/isa.hpp"
#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"

namespace locus {

/// Variance of one point across its surface: ranging noise of the supported lidars (2 to 3 cm), averaged over the ten
/// and more returns of an arc. On walls 6 mm are measured, with real and with synthetic lidars.
inline constexpr float kPointVariance_m2 = 0.01F * 0.01F;

/// Index of a voxel: 21 bits per axis, so 1000 km at half a metre.
struct VoxelIndex {
  std::int32_t x, y, z;
  friend bool operator==(const VoxelIndex&, const VoxelIndex&) = default;
};

/// Part of a voxel that registration reads: the plane through its points, or their scatter.
struct Surface {
  Eigen::Vector3f mean_m = Eigen::Vector3f::Zero(); ///< relative to the centre of the voxel
  Eigen::Vector3f normal = Eigen::Vector3f::Zero(); ///< unit
  float variance_m2 = -1.0F;                        ///< along the normal; negative: no plane
  float tilt_rad2 = 0.0F;                           ///< variance of the normal, about its least certain axis
  /// Variance of a point where there is no plane: that of the voxel's points about their mean, and of the space between
  /// scan lines. Negative: too few points; zero: all are of one sweep, and lie where its scan lines fell.
  float strewn_m2 = -1.0F;
  [[nodiscard]] bool planar() const { return variance_m2 > 0.0F; }
  [[nodiscard]] bool shapeless() const { return !planar() && strewn_m2 > 0.0F; }
  /// Tells whether the space is occupied, by a surface of unknown shape.
  [[nodiscard]] bool unknown() const { return !planar() && strewn_m2 == 0.0F; }
};

/// Running Gaussians of points in cubic voxels, found by hashing.
///
/// Planes are read from it. Along a plane the points of a sweep lie where the scan lines happen to fall, a pattern
/// that moves with the lidar: anything else read from a voxel would follow the robot. Where planes are few, the scatter
/// of points serves as well, if it is that of several sweeps (docs/decisions/056). A voxel with enough points is
/// judged by their positions. One with fewer also uses the normals of the points: moment matching of discs, so a single
/// point with a normal makes a plane. Voxels are stored in a pool of fixed size; when it is full, the oldest one far
/// from the robot is evicted. Neither insertion nor look-up walks the whole map. One writer or many readers.
class SurfaceGrid {
 public:
  /// `of_one_sweep`: shapes are read from one sweep, because there will be no other.
  SurfaceGrid(double leaf_m, std::size_t max_bytes, Isa isa = best_isa(), bool of_one_sweep = false);

  /// Points with the unit normals of their surfaces, or zero: one batch for insert().
  struct Points {
    static constexpr std::size_t kMost = 64;
    std::array<double, kMost> x_m{}, y_m{}, z_m{};
    std::array<float, kMost> normal_x{}, normal_y{}, normal_z{};
    std::size_t count = 0;
    [[nodiscard]] Eigen::Vector3d position_m(std::size_t i) const { return {x_m[i], y_m[i], z_m[i]}; }
  };

  /// Inserts points; those out of reach are dropped. Call refresh() before reading surfaces again. Returns the number
  /// of points in voxels that were empty at the last refresh().
  std::size_t insert(const Points& points);
  /// Updates the surfaces of the voxels that were written to since the last call.
  void refresh();
  void clear();
  /// Protects voxels nearer than `radius_m` to `centre_m` from eviction while there are others.
  void protect(const Eigen::Vector3d& centre_m, double radius_m);

  /// Returns whether a point is finite and within 2^20 voxels of the origin: 500 km at half a metre.
  [[nodiscard]] bool reaches(const Eigen::Vector3d& point_m) const {
    return (point_m.array().abs() < kMaxIndex * leaf_m_).all();
  }

  /// Returns the voxel with the nearest centre; centres are multiples of the leaf, so the floor at height zero does not
  /// lie between two voxels. Precondition: reaches(point).
  [[nodiscard]] VoxelIndex index_of(const Eigen::Vector3d& point_m) const;
  [[nodiscard]] Eigen::Vector3d centre_of(VoxelIndex index) const;
  /// Returns the surface of a voxel, or nullptr if it contains no point.
  [[nodiscard]] const Surface* find(VoxelIndex index) const;
  /// Finds many at once; both spans have the same size. The memory latencies overlap.
  void find(std::span<const VoxelIndex> indices, std::span<const Surface*> surfaces) const;

  [[nodiscard]] double leaf_m() const { return leaf_m_; }
  [[nodiscard]] std::size_t size() const { return used_; }
  [[nodiscard]] std::size_t capacity() const { return voxels_.size(); }
  [[nodiscard]] std::uint64_t evicted() const { return evicted_; }
  /// Calls `use` with the mean and the surface of each voxel, in arbitrary order.
  template <class Use> void for_each(const Use& use) const {
    for (std::size_t slot = 0; slot < used_; ++slot)
      use(Eigen::Vector3d{centre(slot) + surface(slot).mean_m.cast<double>()}, surface(slot));
  }
  /// Slots are 0..size()-1, in arbitrary order.
  [[nodiscard]] const Surface& surface(std::size_t slot) const { return voxels_[slot].surface; }
  [[nodiscard]] Eigen::Vector3d centre(std::size_t slot) const { return centre_of(voxels_[slot].index); }

 private:
  static constexpr double kMaxIndex = 1 << 20;
  static constexpr std::uint32_t kEmpty = 0xFFFFFFFFU;
  struct Entry {
    std::uint32_t tag = 0; ///< upper half of the hash: tells most other voxels apart without an access to the pool
    std::uint32_t slot = kEmpty;
  };
  struct Voxel {
    VoxelIndex index;
    Surface surface;
  };
  /// Sums over points, relative to the centre of the voxel.
  enum Sum : std::size_t {
    kCount,
    kX,
    kY,
    kZ,
    kXx,
    kXy,
    kXz,
    kYy,
    kYz,
    kZz,
    kNxx,
    kNxy,
    kNxz,
    kNyy,
    kNyz,
    kNzz, ///< of the normals of points that have one
    kSums
  };
  struct Moments { ///< apart from Voxel, which is read far more often
    std::array<float, kSums> sums{};
    bool touched = false;
    bool fresh = true;   ///< not refreshed yet
    bool shaped = false; ///< its points are of enough sweeps for a shape
  };
  struct Places;

  [[nodiscard]] std::size_t home_of(VoxelIndex index) const;
  [[nodiscard]] std::uint32_t slot_of(VoxelIndex index, std::uint64_t hash) const;
  std::uint32_t find_or_create(VoxelIndex index, std::uint64_t hash);
  void place(const Points& points, Places& places) const;
  void add(const Points& points, const Places& places, std::size_t i, std::uint32_t slot);
  std::uint32_t allocate_slot();
  void erase_entry(VoxelIndex index);
  void fit(std::span<const std::uint32_t> slots);

  double leaf_m_;
  Isa isa_;
  bool of_one_sweep_;
  std::vector<Entry> entries_; ///< open addressing, linear probing, power of two, at most half full
  std::vector<Voxel> voxels_;
  std::vector<Moments> moments_;
  std::vector<std::uint32_t> touched_;
  std::size_t used_ = 0;
  std::size_t hand_ = 0; ///< next slot to be considered for eviction
  std::uint64_t evicted_ = 0;
  Eigen::Vector3d protected_centre_m_ = Eigen::Vector3d::Zero();
  double protected_radius_m_ = 0.0;
};

/// Replaces `planes` by the planes of a grid: all, or those nearer than `radius_m` to `centre_m`.
void read_planes(const SurfaceGrid& grid, std::vector<SurfacePoint>& planes,
                 const Eigen::Vector3d& centre_m = Eigen::Vector3d::Zero(),
                 double radius_m = std::numeric_limits<double>::infinity());

} // namespace locus
