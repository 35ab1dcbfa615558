// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/isa.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Motion of points from the frame of a lidar to that of the sweep while a packet is fired: linear in time.
struct PacketMotion {
  Eigen::Matrix3f R = Eigen::Matrix3f::Identity(); ///< at the stamp of the packet
  Eigen::Vector3f t_m = Eigen::Vector3f::Zero();
  Eigen::Matrix3f R_per_s = Eigen::Matrix3f::Zero();
  Eigen::Vector3f t_mps = Eigen::Vector3f::Zero();
  float stamp_s = 0.0F; ///< since the start of the sweep

  /// Transforms a point fired `time_s` after the start of the sweep.
  [[nodiscard]] Eigen::Vector3f place(const Eigen::Vector3f& p_lidar_m, float time_s) const {
    return R * p_lidar_m + t_m + (time_s - stamp_s) * (R_per_s * p_lidar_m + t_mps);
  }
};

/// Gathers returns into short arcs of their scan line as they arrive: a downsampling without hashing or searching.
///
/// A segment ends when it is longer than the leaf, when the range jumps to another surface, and when the laser has had
/// no return for a whole packet. It lasts a few milliseconds at most, so its returns are averaged in the frame of the
/// lidar, and only the centroid is corrected for motion, at their mean time of firing. The leaf adapts from sweep to
/// sweep so that the number of segments is about points_wanted(). Memory is fixed at construction. One owner.
class RingSegments {
 public:
  static constexpr std::size_t kMaxSegments = 65536;
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  using Mask = FiringGroup::PerLaser<std::int32_t>; ///< -1 for a selected return, 0 for any other

  /// `points_wanted` per sweep; nothing: as many as the scan lines of each sweep ask for.
  RingSegments(std::size_t lidars, std::optional<std::size_t> points_wanted, Isa isa = best_isa());

  /// Sets the motion of the lidar. Must be called before the firing groups of each packet.
  void begin_packet(std::size_t lidar, const PacketMotion& motion);

  /// Adds the returns of a firing group selected by `counts`. Returns how many of them were dropped for lack of memory.
  std::size_t add(std::size_t lidar, const FiringGroup& group, const Mask& counts);

  /// Returns the segment that the latest return of a laser was added to; kNone if all segments were in use.
  [[nodiscard]] std::uint32_t latest(std::size_t lidar, std::size_t laser) const;

  /// Writes the centroids sorted by scan line, then by time, with age_s = duration_s - time; adapts the leaf and starts
  /// over. Afterwards place_of() returns the index of a segment in `points`: kNone for one that was dropped because it
  /// goes round a corner.
  void finish(float duration_s, std::vector<SweepPoint>& points);
  [[nodiscard]] std::uint32_t place_of(std::uint32_t segment) const { return place_[segment]; }

  /// Returns the number of points that registration should use of the latest finished sweep.
  [[nodiscard]] std::size_t points_wanted() const { return points_wanted_; }

 private:
  /// Open segments of sixteen lasers.
  struct Bank {
    template <class T> using PerLaser = FiringGroup::PerLaser<T>;
    PerLaser<float> first_x{}, first_y{}, first_z{};
    PerLaser<float> last_x{}, last_y{}, last_z{};
    PerLaser<float> sum_x{}, sum_y{}, sum_z{};
    PerLaser<float> time_sum_s{}, intensity_sum{}, last_range_m{};
    PerLaser<float> count{}; ///< 0: no open segment
    PerLaser<std::int32_t> last_packet{};
    PerLaser<std::uint32_t> id{};
    PerLaser<std::uint8_t> ring{};

    void add(FiringGroup group, Mask begins, Mask accepted, float stamp_s, std::int32_t packet);
  };
  struct Lidar {
    PacketMotion motion;
    std::int32_t packet = 0;    ///< counted from 1 in each sweep
    std::size_t banks_used = 0; ///< number of banks with returns so far
    std::array<Bank, LidarPacket::kMaxLasers / FiringGroup::kLasers> storage;
    std::span<Bank> banks() { return std::span(storage).first(banks_used); }
  };
  struct Segment {
    SweepPoint point; ///< age_s is still the time since the start of the sweep
    std::uint32_t id;
  };

  [[nodiscard]] Mask beginnings_in(const Bank& bank, const FiringGroup& group, const Mask& counts) const;
  std::uint32_t open();
  void close(std::size_t lidar, Bank& bank, std::size_t laser);

  Isa isa_;
  std::optional<std::size_t> points_requested_;
  std::size_t points_wanted_;
  float leaf_m_;
  std::vector<Lidar> lidars_;
  std::vector<Segment> segments_; ///< closed segments, in order of closing
  std::uint32_t opened_ = 0;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> line_begin_;
};

} // namespace locus
