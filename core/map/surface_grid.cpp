// SPDX-License-Identifier: Apache-2.0
#include "core/map/surface_grid.hpp"

#include <algorithm>
#include <array>
#include <bit>

namespace locus {

namespace {

/// Number of points in a voxel above which older ones fade, so that a long stay does not freeze it.
constexpr float kMaxCount = 400.0F;

constexpr std::size_t kEvictionAttempts = 64;

/// Voxels looked up at a time: their memory latencies overlap.
constexpr std::size_t kAtOnce = 64;

/// Replaces std::floor, which is a function call where the baseline has no instruction for it.
std::int32_t floor_of(double v) {
  const auto truncated = static_cast<std::int32_t>(v);
  return truncated - (v < truncated ? 1 : 0);
}

std::uint64_t hash_of(VoxelIndex index) {
  const auto bits = [](std::int32_t i) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(i)) & 0x1FFFFFU;
  };
  std::uint64_t h = bits(index.x) | bits(index.y) << 21U | bits(index.z) << 42U;
  h *= 0xD6E8FEB86659FD93ULL;
  return h ^ h >> 32U;
}

} // namespace

SurfaceGrid::SurfaceGrid(double leaf_m, std::size_t max_bytes, Isa isa, bool of_one_sweep)
    : leaf_m_(leaf_m), isa_(isa), of_one_sweep_(of_one_sweep) {
  constexpr std::size_t kBytesPerVoxel = sizeof(Voxel) + sizeof(Moments) + sizeof(std::uint32_t) + 4 * sizeof(Entry);
  const std::size_t capacity = std::max<std::size_t>(max_bytes / kBytesPerVoxel, 64);
  entries_.resize(std::bit_ceil(2 * capacity));
  voxels_.resize(capacity);
  moments_.resize(capacity);
  touched_.reserve(capacity);
}

VoxelIndex SurfaceGrid::index_of(const Eigen::Vector3d& point_m) const {
  const auto cell = [this](double v) { return floor_of(v / leaf_m_ + 0.5); };
  return {cell(point_m.x()), cell(point_m.y()), cell(point_m.z())};
}

Eigen::Vector3d SurfaceGrid::centre_of(VoxelIndex index) const {
  return leaf_m_ *
         Eigen::Vector3d{static_cast<double>(index.x), static_cast<double>(index.y), static_cast<double>(index.z)};
}

std::size_t SurfaceGrid::home_of(VoxelIndex index) const { return hash_of(index) & (entries_.size() - 1); }

std::uint32_t SurfaceGrid::slot_of(VoxelIndex index, std::uint64_t hash) const {
  const auto tag = static_cast<std::uint32_t>(hash >> 32U);
  const std::size_t mask = entries_.size() - 1;
  for (std::size_t i = hash & mask;; i = (i + 1) & mask) {
    const Entry& entry = entries_[i];
    if (entry.slot == kEmpty || (entry.tag == tag && voxels_[entry.slot].index == index))
      return entry.slot;
  }
}

const Surface* SurfaceGrid::find(VoxelIndex index) const {
  const std::uint32_t slot = slot_of(index, hash_of(index));
  return slot == kEmpty ? nullptr : &voxels_[slot].surface;
}

void SurfaceGrid::find(std::span<const VoxelIndex> indices, std::span<const Surface*> surfaces) const {
  std::array<std::uint64_t, kAtOnce> hashes;
  const std::size_t mask = entries_.size() - 1;
  for (std::size_t begin = 0; begin < indices.size(); begin += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, indices.size() - begin);
    for (std::size_t i = 0; i < count; ++i) {
      hashes[i] = hash_of(indices[begin + i]);
      __builtin_prefetch(&entries_[hashes[i] & mask]);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const Entry& home = entries_[hashes[i] & mask];
      if (home.slot != kEmpty)
        __builtin_prefetch(&voxels_[home.slot]);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t slot = slot_of(indices[begin + i], hashes[i]);
      surfaces[begin + i] = slot == kEmpty ? nullptr : &voxels_[slot].surface;
    }
  }
}

std::uint32_t SurfaceGrid::find_or_create(VoxelIndex index, std::uint64_t hash) {
  const std::uint32_t found = slot_of(index, hash);
  if (found != kEmpty)
    return found;
  const std::uint32_t slot = allocate_slot();
  voxels_[slot] = {index, Surface{}};
  moments_[slot] = Moments{};
  const std::size_t mask = entries_.size() - 1;
  std::size_t i = hash & mask;
  while (entries_[i].slot != kEmpty)
    i = (i + 1) & mask;
  entries_[i] = {static_cast<std::uint32_t>(hash >> 32U), slot};
  return slot;
}

std::uint32_t SurfaceGrid::allocate_slot() {
  if (used_ < capacity())
    return static_cast<std::uint32_t>(used_++);
  if (2 * touched_.size() > capacity())
    refresh(); // touched voxels cannot be evicted, so some must become untouched
  const double radius2 = protected_radius_m_ * protected_radius_m_;
  const auto is_near = [&] { return (centre(hand_) - protected_centre_m_).squaredNorm() < radius2; };
  for (std::size_t attempt = 0; attempt < kEvictionAttempts && is_near(); ++attempt)
    hand_ = (hand_ + 1) % capacity();
  while (moments_[hand_].touched)
    hand_ = (hand_ + 1) % capacity();
  const std::size_t slot = hand_;
  hand_ = (hand_ + 1) % capacity();
  erase_entry(voxels_[slot].index);
  ++evicted_;
  return static_cast<std::uint32_t>(slot);
}

/// Erases an entry. Linear probing without tombstones: entries behind the gap move up if that brings them closer to
/// home.
void SurfaceGrid::erase_entry(VoxelIndex index) {
  const std::size_t mask = entries_.size() - 1;
  std::size_t gap = home_of(index);
  while (voxels_[entries_[gap].slot].index != index)
    gap = (gap + 1) & mask;
  for (std::size_t i = (gap + 1) & mask; entries_[i].slot != kEmpty; i = (i + 1) & mask) {
    const std::size_t home = home_of(voxels_[entries_[i].slot].index);
    if (((i - home) & mask) >= ((i - gap) & mask)) {
      entries_[gap] = entries_[i];
      gap = i;
    }
  }
  entries_[gap] = Entry{};
}

/// Voxels of points, and offsets from the voxel centres.
struct SurfaceGrid::Places {
  std::array<std::int32_t, Points::kMost> cell_x, cell_y, cell_z;
  std::array<float, Points::kMost> x_m, y_m, z_m;
  std::array<std::uint64_t, Points::kMost> hash;
};

/// Finds the voxels of points; arbitrary for points out of reach.
void SurfaceGrid::place(const Points& points, Places& places) const {
  const auto along = [leaf_m = leaf_m_](const auto& points_m, auto& cell, auto& offset_m) {
    const double per_m = 1.0 / leaf_m;
    for (std::size_t i = 0; i < Points::kMost; ++i) {
      const double cells = std::clamp(points_m[i] * per_m, -2.0 * kMaxIndex, 2.0 * kMaxIndex) + 0.5;
      const auto truncated = static_cast<std::int32_t>(cells);
      cell[i] = truncated - static_cast<std::int32_t>(cells < static_cast<double>(truncated));
    }
    for (std::size_t i = 0; i < Points::kMost; ++i)
      offset_m[i] = static_cast<float>(points_m[i] - leaf_m * static_cast<double>(cell[i]));
  };
  run_as(isa_, [&] {
    along(points.x_m, places.cell_x, places.x_m);
    along(points.y_m, places.cell_y, places.y_m);
    along(points.z_m, places.cell_z, places.z_m);
  });
}

std::size_t SurfaceGrid::insert(const Points& points) {
  Places places;
  place(points, places);
  const auto index_of_place = [&](std::size_t i) {
    return VoxelIndex{places.cell_x[i], places.cell_y[i], places.cell_z[i]};
  };
  const std::size_t mask = entries_.size() - 1;
  for (std::size_t i = 0; i < points.count; ++i) {
    places.hash[i] = hash_of(index_of_place(i));
    __builtin_prefetch(&entries_[places.hash[i] & mask]);
  }
  for (std::size_t i = 0; i < points.count; ++i)
    if (const Entry& home = entries_[places.hash[i] & mask]; home.slot != kEmpty)
      __builtin_prefetch(&moments_[home.slot], 1);
  std::size_t fresh = 0;
  for (std::size_t i = 0; i < points.count; ++i) {
    if (!reaches(points.position_m(i)))
      continue;
    const std::uint32_t slot = find_or_create(index_of_place(i), places.hash[i]);
    add(points, places, i, slot);
    fresh += moments_[slot].fresh ? 1U : 0U;
  }
  return fresh;
}

void SurfaceGrid::add(const Points& points, const Places& places, std::size_t i, std::uint32_t slot) {
  Moments& moments = moments_[slot];
  if (!moments.touched) {
    moments.touched = true;
    moments.shaped = of_one_sweep_ || !moments.fresh;
    touched_.push_back(slot);
  }
  if (moments.sums[kCount] >= kMaxCount)
    for (float& sum : moments.sums)
      sum *= 0.5F;
  const float x = places.x_m[i], y = places.y_m[i], z = places.z_m[i];
  const float nx = points.normal_x[i], ny = points.normal_y[i], nz = points.normal_z[i];
  const std::array<float, kSums> of_point{1.0F,  x,     y,       z,       x * x,   x * y,   x * z,   y * y,
                                          y * z, z * z, nx * nx, nx * ny, nx * nz, ny * ny, ny * nz, nz * nz};
  for (std::size_t sum = 0; sum < kSums; ++sum)
    moments.sums[sum] += of_point[sum];
}

/// Empties the table from each voxel's home to the next gap, which reaches all entries: each lies behind the home of
/// its voxel with no gap between.
void SurfaceGrid::clear() {
  const std::size_t mask = entries_.size() - 1;
  for (std::size_t slot = 0; slot < used_; ++slot) {
    for (std::size_t i = home_of(voxels_[slot].index); entries_[i].slot != kEmpty; i = (i + 1) & mask)
      entries_[i] = Entry{};
  }
  touched_.clear();
  used_ = 0;
  hand_ = 0;
}

void SurfaceGrid::protect(const Eigen::Vector3d& centre_m, double radius_m) {
  protected_centre_m_ = centre_m;
  protected_radius_m_ = radius_m;
}

void read_planes(const SurfaceGrid& grid, std::vector<SurfacePoint>& planes, const Eigen::Vector3d& centre_m,
                 double radius_m) {
  planes.clear();
  grid.for_each([&](const Eigen::Vector3d& mean_m, const Surface& surface) {
    if (surface.planar() && (mean_m - centre_m).norm() < radius_m)
      planes.push_back({mean_m.cast<float>(), surface.normal});
  });
}

} // namespace locus
