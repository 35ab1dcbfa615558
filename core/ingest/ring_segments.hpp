// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/isa.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// How points move from the frame of a lidar to that of the sweep while a packet is fired: linear in time.
struct PacketMotion {
  Eigen::Matrix3f R = Eigen::Matrix3f::Identity(); ///< at the stamp of the packet
  Eigen::Vector3f t_m = Eigen::Vector3f::Zero();
  Eigen::Matrix3f R_per_s = Eigen::Matrix3f::Zero();
  Eigen::Vector3f t_mps = Eigen::Vector3f::Zero();
  float stamp_s = 0.0F; ///< from the start of the sweep

  /// `time_s` from the start of the sweep.
  [[nodiscard]] Eigen::Vector3f place(const Eigen::Vector3f& p_lidar_m, float time_s) const {
    return R * p_lidar_m + t_m + (time_s - stamp_s) * (R_per_s * p_lidar_m + t_mps);
  }
};

/// Gathers returns into short arcs of their scan line as they come in: a downsampling that needs no hash and no search.
///
/// A segment ends where it has grown longer than the leaf, where the range jumps to another surface, and where the
/// laser has seen nothing for a whole packet. It lasts for a few milliseconds at most, so its returns are averaged in
/// the frame of the lidar, and only the centroid is corrected for motion, with the instant that is their mean. The leaf
/// follows the scene from sweep to sweep so that about as many segments come out as were asked for. Memory is fixed at
/// construction. One owner.
class RingSegments {
 public:
  static constexpr std::size_t kMaxSegments = 65536;
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  using Mask = FiringGroup::PerLaser<std::int32_t>; ///< -1 for a return that counts, 0 for one that does not

  RingSegments(std::size_t lidars, std::size_t points_wanted, Isa isa = best_isa());

  /// Says how the lidar moves from now on. To be called before the firing groups of each packet.
  void begin_packet(std::size_t lidar, const PacketMotion& motion);

  /// Takes in those returns of a firing group that count. Gives back how many of them did not fit into memory.
  std::size_t add(std::size_t lidar, const FiringGroup& group, const Mask& counts);

  /// The segment that the latest return of a laser went into; kNone when all were in use.
  [[nodiscard]] std::uint32_t latest(std::size_t lidar, std::size_t laser) const;

  /// Writes the centroids sorted by scan line, in it by time, with age_s = duration_s - time; steers the leaf and
  /// starts over. After it place_of() tells where a segment went: kNone for one that went round a corner and was left
  /// out.
  void finish(float duration_s, std::vector<SweepPoint>& points);
  [[nodiscard]] std::uint32_t place_of(std::uint32_t segment) const { return place_[segment]; }

 private:
  /// The open segments of sixteen lasers.
  struct Bank {
    template <class T> using PerLaser = FiringGroup::PerLaser<T>;
    PerLaser<float> first_x{}, first_y{}, first_z{};
    PerLaser<float> last_x{}, last_y{}, last_z{};
    PerLaser<float> sum_x{}, sum_y{}, sum_z{};
    PerLaser<float> time_sum_s{}, intensity_sum{}, last_range_m{};
    PerLaser<float> count{}; ///< 0: none is open
    PerLaser<std::int32_t> last_packet{};
    PerLaser<std::uint32_t> id{};
    PerLaser<std::uint8_t> ring{};

    void take(FiringGroup group, Mask begins, Mask takes, float stamp_s, std::int32_t packet);
  };
  struct Lidar {
    PacketMotion motion;
    std::int32_t packet = 0;    ///< counted from 1 in each sweep
    std::size_t banks_used = 0; ///< as many as the lidar has shown
    std::array<Bank, LidarPacket::kMaxLasers / FiringGroup::kLasers> storage;
    std::span<Bank> banks() { return std::span(storage).first(banks_used); }
  };
  struct Segment {
    SweepPoint point; ///< age_s still counts from the start of the sweep
    std::uint32_t id;
  };

  [[nodiscard]] Mask beginnings_in(const Bank& bank, const FiringGroup& group, const Mask& counts) const;
  std::uint32_t open();
  void close(std::size_t lidar, Bank& bank, std::size_t laser);

  Isa isa_;
  std::size_t points_wanted_;
  float leaf_m_;
  std::vector<Lidar> lidars_;
  std::vector<Segment> segments_; ///< closed, in the order of that
  std::uint32_t opened_ = 0;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> line_begin_;
};

} // namespace locus
