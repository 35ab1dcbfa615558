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

/// Return of a sweep, with its laser and time.
struct KittiReturn {
  KittiPoint point;
  double turned;    ///< fraction of the turn, 0..1
  std::size_t ring; ///< in file order, from the highest
};

/// Upper bound on the rings of points of KITTI's HDL-64E.
inline constexpr std::size_t kKittiRings = 64;

/// Replaces `returns` by the finite points of non-zero range and derives ring and azimuth from their order: they are
/// stored ring by ring from the highest down, each counter-clockwise from the front. Returns the number of rings;
/// nothing if the order differs.
std::optional<std::size_t> find_returns(std::span<const KittiPoint> points, std::vector<KittiReturn>& returns);

/// Converts a sweep of KITTI's HDL-64E back to packets: a turn that starts at the rear and runs clockwise at constant
/// speed.
///
/// The file has neither the time nor the ring of a point. Its time follows from its azimuth, its ring from
/// find_returns(). Memory is reused from sweep to sweep. One owner.
class KittiSweep {
 public:
  /// Starts on the packets of these points, without those that are not finite or at zero range. Returns false, and
  /// starts nothing, if the order of the points differs. Precondition: at most kMaxKittiPoints; start < end.
  bool begin(std::span<const KittiPoint> points, Stamp start, Stamp end);

  /// Returns the next packet, valid until the next call; nullptr after the last of the sweep. Packets may be empty.
  const LidarPacket* next();

 private:
  static constexpr std::size_t kRings = kKittiRings;
  static constexpr std::size_t kColumns = 4000; ///< twice as many as it fires, so that points rarely share one
  static constexpr std::size_t kGroupsPerColumn = kRings / FiringGroup::kLasers;
  static constexpr std::size_t kColumnsPerPacket = 6;

  void fill(std::size_t column, std::size_t bank, FiringGroup& group) const;

  std::vector<KittiReturn> returns_;
  std::size_t rings_ = 0;            ///< present in the sweep
  std::vector<std::uint32_t> cells_; ///< by column and ring: the index in returns_ plus one, or 0
  Stamp start_, end_;
  std::size_t column_ = kColumns;
  LidarPacket packet_;
};

} // namespace locus::tools
