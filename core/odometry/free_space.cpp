// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/free_space.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>

namespace locus {

namespace {

/// Longest validity of free space: while a robot stands, anything may move into it.
constexpr Duration kRecent = std::chrono::seconds{10};

/// Margin by which a point must be nearer, or farther, than the returns in its direction: a fine voxel of the map, and
/// the effect of an error of direction on the range.
constexpr float kApart_m = 0.5F, kApartShare = 0.05F;
constexpr float apart_m(float range_m) { return kApart_m + kApartShare * range_m; }

/// Least number of returns in a direction and its eight neighbours, all of them farther away or all nearer.
constexpr int kEnough = 3;

} // namespace

void FreeSpace::expect(const Sweep& sweep) {
  stamp_ = sweep.end;
  lidars_ = sweep.lidars;
  for (Keyframe& keyframe : last_)
    keyframe.views.resize(lidars_.count); // allocates at the first sweep only, as below
  lidar_of_.reserve(sweep.points.capacity());
  standing_.reserve(sweep.points.capacity());
  lidar_of_.clear();
  for (const SweepPoint& point : sweep.points)
    lidar_of_.push_back(lidar_of(point));
}

std::span<const SurfacePoint> FreeSpace::leave_out_contradicting(std::span<const SurfacePoint> scan_base,
                                                                 const Pose& T_odom_base, const SurfaceMap& map) {
  const Eigen::Matrix3f R_odom_base = T_odom_base.R().cast<float>();
  const Eigen::Vector3f t_odom_base = T_odom_base.translation.cast<float>();
  standing_.clear();
  std::ranges::copy_if(scan_base, std::back_inserter(standing_), [&](const SurfacePoint& point) {
    const Eigen::Vector3f point_odom_m = R_odom_base * point.position_m + t_odom_base;
    return !is_free(point_odom_m) && (!is_hidden(point_odom_m) || map.is_occupied(point_odom_m.cast<double>()));
  });
  add_keyframe(scan_base, T_odom_base);
  return standing_;
}

bool FreeSpace::is_free(const Eigen::Vector3f& point_odom_m) const {
  for (std::size_t i = 0; i < std::min(keyframes_, kKeyframes); ++i)
    if (is_recent(last_[i]) &&
        std::ranges::any_of(last_[i].views, [&](const View& view) { return sees_through(view, point_odom_m); }))
      return true;
  return false;
}

/// Tells whether the surfaces that the last keyframe saw hide a point from all of its lidars that saw any there.
bool FreeSpace::is_hidden(const Eigen::Vector3f& point_odom_m) const {
  if (keyframes_ == 0)
    return false;
  const Keyframe& last = last_[(keyframes_ - 1) % kKeyframes];
  bool hidden = false;
  for (const View& view : last.views) {
    const std::optional<int> nearer = count_around(view, point_odom_m, [](const Returns& returns, float range_m) {
      return returns.farthest_m <= range_m - apart_m(range_m);
    });
    if (!nearer)
      return false;
    hidden = hidden || *nearer >= kEnough;
  }
  return hidden && is_recent(last);
}

bool FreeSpace::is_recent(const Keyframe& keyframe) const {
  return std::chrono::abs(stamp_ - keyframe.stamp) < kRecent;
}

bool FreeSpace::sees_through(const View& view, const Eigen::Vector3f& point_odom_m) {
  const auto is_farther = [](const Returns& returns, float range_m) {
    return returns.nearest_m >= range_m + apart_m(range_m);
  };
  return count_around(view, point_odom_m, is_farther).value_or(0) >= kEnough;
}

/// Returns how many of the cells in the direction of a point and around it have returns, or nothing if
/// `holds(returns, range of the point)` is false for one of them.
template <class Condition>
std::optional<int> FreeSpace::count_around(const View& view, const Eigen::Vector3f& point_odom_m,
                                           const Condition& holds) {
  const Eigen::Vector3f direction = view.R_view_odom * (point_odom_m - view.lidar_odom_m);
  const float range_m = direction.norm();
  const Cell at = cell_of(direction, range_m);
  int seen = 0;
  for (int row = std::max(at.row - 1, 0); row <= std::min(at.row + 1, kRows - 1); ++row)
    for (int side = -1; side <= 1; ++side) {
      const int column = (at.column + side + kColumns) % kColumns;
      const Returns& returns = view.returns[static_cast<std::size_t>(row * kColumns + column)];
      if (returns.farthest_m == 0.0F)
        continue;
      if (!holds(returns, range_m))
        return std::nullopt;
      ++seen;
    }
  return seen;
}

/// Returns the cell without computing angles: columns divide a diamond around the origin instead of a circle, rows the
/// sine.
FreeSpace::Cell FreeSpace::cell_of(const Eigen::Vector3f& direction, float range_m) {
  constexpr float kTiny_m = 1e-6F; ///< guards against a zero direction
  const float x = direction.x(), y = direction.y();
  const float along = y / (std::abs(x) + std::abs(y) + kTiny_m);
  const float around = x < 0.0F ? 2.0F - along : along + (along < 0.0F ? 4.0F : 0.0F); // of four
  const float up = direction.z() / (range_m + kTiny_m) + 1.0F;                         // of two
  return {std::clamp(static_cast<int>(around * (static_cast<float>(kColumns) / 4.0F)), 0, kColumns - 1),
          std::clamp(static_cast<int>(up * (static_cast<float>(kRows) / 2.0F)), 0, kRows - 1)};
}

void FreeSpace::add_keyframe(std::span<const SurfacePoint> scan_base, const Pose& T_odom_base) {
  Keyframe& keyframe = last_[keyframes_++ % kKeyframes];
  keyframe.stamp = stamp_;
  for (std::size_t i = 0; i < lidars_.count; ++i) {
    View& view = keyframe.views[i];
    view.lidar_odom_m = (T_odom_base * lidars_.base_m[i].cast<double>()).cast<float>();
    view.R_view_odom = T_odom_base.R().transpose().cast<float>();
    view.returns.fill({});
  }
  for (std::size_t i = 0; i < scan_base.size(); ++i) {
    const std::size_t lidar = lidar_of_[i];
    if (lidar >= lidars_.count)
      continue;
    const Eigen::Vector3f direction = scan_base[i].position_m - lidars_.base_m[lidar];
    const float range_m = direction.norm();
    const Cell at = cell_of(direction, range_m);
    Returns& returns = keyframe.views[lidar].returns[static_cast<std::size_t>(at.row * kColumns + at.column)];
    returns.nearest_m = std::min(returns.nearest_m, range_m);
    returns.farthest_m = std::max(returns.farthest_m, range_m);
  }
}

} // namespace locus
