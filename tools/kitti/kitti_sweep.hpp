// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/ingest/lidar_packet.hpp"
#include "kitti/kitti_points.hpp"

namespace locus::tools {

/// A point of a sweep that lidar saw.
struct KittiReturn {
  KittiPoint point;
  double turned;    ///< share of the turn, 0..1
  std::size_t ring; ///< counted as they lie in the file, from the highest
};

/// The most rings that the points of KITTI's HDL-64E lie in.
inline constexpr std::size_t kKittiRings = 64;

/// Replaces `returns` by the points that are finite and not at zero range, with what their order tells: they lie ring
/// by ring from the highest down, in each counter-clockwise from the front. Gives back how many rings there are;
/// nothing if they are not in that order.
std::optional<std::size_t> find_returns(std::span<const KittiPoint> points, std::vector<KittiReturn>& returns);

/// Makes packets again of a sweep of KITTI's HDL-64E: a turn that begins at the rear and goes clockwise, at one speed.
///
/// A point has no time and no ring in the file. Its time follows from its azimuth, its ring from find_returns(). One
/// owner; memory is used again from sweep to sweep.
class KittiSweep {
 public:
  /// Begins with the packets of these points; those that are not finite or at zero range are left out. False if the
  /// points are not in that order, and nothing is begun. Precondition: at most kMaxKittiPoints; start < end.
  bool begin(std::span<const KittiPoint> points, Stamp start, Stamp end);

  /// The next packet, valid until the next call; nullptr after the last of the sweep. Packets may be empty.
  const LidarPacket* next();

 private:
  static constexpr std::size_t kRings = kKittiRings;
  static constexpr std::size_t kColumns = 4000; ///< twice as many as it fires, so that two points seldom meet in one
  static constexpr std::size_t kGroupsPerColumn = kRings / FiringGroup::kLasers;
  static constexpr std::size_t kColumnsPerPacket = 6;

  void fill(std::size_t column, std::size_t bank, FiringGroup& group) const;

  std::vector<KittiReturn> returns_;
  std::size_t rings_ = 0;            ///< that were seen
  std::vector<std::uint32_t> cells_; ///< by column and ring: the place in returns_ plus one, or 0
  Stamp start_, end_;
  std::size_t column_ = kColumns;
  LidarPacket packet_;
};

} // namespace locus::tools
