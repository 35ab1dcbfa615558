// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/names.hpp"
#include "core/ingest/lidar_packet.hpp"

namespace locus {

/// Source of the rings: a field of the message, the rows of an organised cloud, peaks in the elevations of the points,
/// or equal bands of elevation if there are no peaks.
enum class RingsFrom : std::uint8_t { field, rows, elevation, bands };
constexpr auto names_of(RingsFrom) { return std::to_array<std::string_view>({"field", "rows", "elevation", "bands"}); }

/// Assigns a laser to each point of a cloud, and orders the lasers by elevation. Single owner, not thread-safe;
/// allocates nothing, throws nothing.
class Rings {
 public:
  static constexpr std::size_t kMax = LidarPacket::kMaxLasers;

  /// Positions of returns, lidar frame, m; all finite and not at the origin.
  struct Positions {
    std::span<const float> x_m, y_m, z_m;
  };

  /// Writes the laser of each point, 0 .. kMax - 1, to `lasers`. `rings`: ring from the field or row; empty if there is
  /// neither. All are ignored if any is out of range.
  void assign(Positions points, std::span<const float> rings, RingsFrom source, std::vector<std::uint8_t>& lasers);

  /// Ring of a laser, ordered by mean observed elevation; 0 is the lowest.
  [[nodiscard]] std::uint8_t ring_of(std::size_t laser) const { return ring_of_[laser]; }
  [[nodiscard]] RingsFrom from() const { return from_; }

 private:
  static constexpr double kBin_rad = 0.0017; ///< a tenth of a degree
  static constexpr std::size_t kBins = 1850; ///< from nadir to zenith

  void find_lines(Positions points);
  void rank(Positions points, std::span<const std::uint8_t> lasers);

  RingsFrom from_ = RingsFrom::field;
  bool lines_known_ = false;
  std::array<std::uint8_t, kBins> laser_of_bin_{};
  std::array<std::uint32_t, kBins> histogram_{};
  std::array<double, kMax> elevation_sum_rad_{};
  std::array<std::uint64_t, kMax> counts_{};
  std::array<std::uint8_t, kMax> ring_of_{};
};

} // namespace locus
