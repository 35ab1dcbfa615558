// SPDX-License-Identifier: Apache-2.0
#include "core/surface_grid.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/principal_axes.hpp"

namespace locus {

namespace {

/// A point stands for a disc, or for a ball where its normal is not known; the radius as a share of the voxel.
constexpr float kDiscRadiusInLeaves = 0.5F;

/// Points on a plane spread in two directions, by an absolute and by a relative measure (one scan line spreads in one
/// only), and little across them. With discs around them they always spread, so there the test across may be milder.
constexpr float kMinSpreadInLeaves = 0.15F;
constexpr float kMinMiddleToGreatest = 0.05F;
constexpr float kMaxAcrossToMiddle = 0.05F;
constexpr float kMaxAcrossToMiddleOfDiscs = 0.15F;
constexpr float kMaxRoughness_m = 0.15F;

/// Enough to be judged by where they lie alone.
constexpr float kEnoughPoints = 4.0F;

/// Least share of the points' own normals that must agree with the plane: where wall and floor meet, a few points of
/// the one tilt the plane through the many of the other, and the tilt drags the map along with the scan lines.
constexpr float kMinAgreement = 0.8F;

/// Older points fade once a voxel has seen this many, so a long stay does not freeze it.
constexpr float kMaxCount = 400.0F;

constexpr std::size_t kEvictionAttempts = 64;

/// Voxels that are looked for at a time: their waits for memory overlap.
constexpr std::size_t kAtOnce = 64;

using Upper = Eigen::Matrix<float, 6, 1>;
const Upper kIdentity{1.0F, 0.0F, 0.0F, 1.0F, 0.0F, 1.0F};

Upper upper_of_outer(const Eigen::Vector3f& v) {
  return {v.x() * v.x(), v.x() * v.y(), v.x() * v.z(), v.y() * v.y(), v.y() * v.z(), v.z() * v.z()};
}

PrincipalAxes<float> axes_of(const Upper& m) { return principal_axes<float>({m[0], m[1], m[2], m[3], m[4], m[5]}); }

/// v' m v
float quadratic(const Upper& m, const Eigen::Vector3f& v) {
  return m[0] * v.x() * v.x() + m[3] * v.y() * v.y() + m[5] * v.z() * v.z() +
         2.0F * (m[1] * v.x() * v.y() + m[2] * v.x() * v.z() + m[4] * v.y() * v.z());
}

/// std::floor is a call where the baseline has no instruction for it.
std::int32_t floor_of(double v) {
  const auto truncated = static_cast<std::int32_t>(v);
  return truncated - (v < truncated ? 1 : 0);
}

std::uint64_t hash_of(VoxelIndex index) {
  const auto bits = [](std::int32_t i) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(i)) & 0x1FFFFFU;
  };
  std::uint64_t h = bits(index.x) | bits(index.y) << 21U | bits(index.z) << 42U;
  h = (h ^ h >> 32U) * 0xD6E8FEB86659FD93ULL;
  h = (h ^ h >> 32U) * 0xD6E8FEB86659FD93ULL;
  return h ^ h >> 32U;
}

} // namespace

SurfaceGrid::SurfaceGrid(double leaf_m, std::size_t max_bytes) : leaf_m_(leaf_m) {
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
  const std::uint32_t slot = take_slot();
  voxels_[slot] = {index, Surface{}};
  moments_[slot] = Moments{};
  const std::size_t mask = entries_.size() - 1;
  std::size_t i = hash & mask;
  while (entries_[i].slot != kEmpty)
    i = (i + 1) & mask;
  entries_[i] = {static_cast<std::uint32_t>(hash >> 32U), slot};
  return slot;
}

std::uint32_t SurfaceGrid::take_slot() {
  if (used_ < capacity())
    return static_cast<std::uint32_t>(used_++);
  if (2 * touched_.size() > capacity())
    refresh(); // touched voxels cannot be evicted, and there must be some that can
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

/// Linear probing without tombstones: entries behind the gap move up as long as that brings them nearer to their home.
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

std::size_t SurfaceGrid::insert(std::span<const Point> points) {
  struct Place {
    const Point* point;
    VoxelIndex index;
    std::uint64_t hash;
  };
  std::array<Place, kAtOnce> places;
  std::size_t fresh = 0;
  while (!points.empty()) {
    std::size_t count = 0;
    for (const Point& point : points.first(std::min(kAtOnce, points.size()))) {
      if (!reaches(point.position_m))
        continue;
      const VoxelIndex index = index_of(point.position_m);
      places[count++] = {&point, index, hash_of(index)};
      __builtin_prefetch(&entries_[places[count - 1].hash & (entries_.size() - 1)]);
    }
    for (const Place& place : std::span(places).first(count))
      if (const Entry& home = entries_[place.hash & (entries_.size() - 1)]; home.slot != kEmpty)
        __builtin_prefetch(&moments_[home.slot], 1);
    for (const Place& place : std::span(places).first(count)) {
      const std::uint32_t slot = find_or_create(place.index, place.hash);
      add(*place.point, place.index, slot);
      fresh += moments_[slot].fresh ? 1U : 0U;
    }
    points = points.subspan(std::min(kAtOnce, points.size()));
  }
  return fresh;
}

void SurfaceGrid::add(const Point& point, VoxelIndex index, std::uint32_t slot) {
  Moments& moments = moments_[slot];
  if (!moments.touched) {
    moments.touched = true;
    touched_.push_back(slot);
  }
  if (moments.count >= kMaxCount) {
    moments.count *= 0.5F;
    moments.sum *= 0.5F;
    moments.outer *= 0.5F;
    moments.normals *= 0.5F;
    moments.normal_count *= 0.5F;
  }
  const Eigen::Vector3f offset = (point.position_m - centre_of(index)).cast<float>();
  moments.count += 1.0F;
  moments.sum += offset;
  moments.outer += upper_of_outer(offset);
  moments.normals += upper_of_outer(point.normal);
  moments.normal_count += point.normal.isZero() ? 0.0F : 1.0F;
}

Surface SurfaceGrid::fit(const Moments& moments) const {
  const auto leaf_m = static_cast<float>(leaf_m_);
  const auto is_plane = [&](const PrincipalAxes<float>& axes, float max_across_to_middle) {
    const float min_spread_m = kMinSpreadInLeaves * leaf_m;
    return axes.middle > min_spread_m * min_spread_m && axes.middle > kMinMiddleToGreatest * axes.greatest &&
           axes.least < max_across_to_middle * axes.middle && axes.least < kMaxRoughness_m * kMaxRoughness_m &&
           quadratic(moments.normals, {axes.x, axes.y, axes.z}) >= kMinAgreement * moments.normal_count;
  };
  Surface surface;
  surface.mean_m = moments.sum / moments.count;
  const Upper scatter = moments.outer / moments.count - upper_of_outer(surface.mean_m);
  PrincipalAxes<float> axes{};
  bool planar = false;
  if (moments.count >= kEnoughPoints) {
    axes = axes_of(scatter);
    planar = is_plane(axes, kMaxAcrossToMiddle);
  }
  if (!planar) {
    const float along_m2 = kDiscRadiusInLeaves * kDiscRadiusInLeaves * leaf_m * leaf_m;
    axes = axes_of(scatter + along_m2 * kIdentity + (kPointVariance_m2 - along_m2) / moments.count * moments.normals);
    planar = is_plane(axes, kMaxAcrossToMiddleOfDiscs);
  }
  surface.normal = {axes.x, axes.y, axes.z};
  if (moments.count >= kEnoughPoints)
    surface.strewn_m2 = (scatter[0] + scatter[3] + scatter[5]) / 3.0F + kPointVariance_m2;
  if (planar)
    surface.variance_m2 = std::max(axes.least, kPointVariance_m2);
  return surface;
}

void SurfaceGrid::refresh() {
  for (const std::uint32_t slot : touched_) {
    voxels_[slot].surface = fit(moments_[slot]);
    moments_[slot].touched = moments_[slot].fresh = false;
  }
  touched_.clear();
}

/// Every entry lies behind its voxel's home with no gap between, so emptying from each home to the next gap empties
/// all.
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

} // namespace locus
