// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/stage_clock.hpp"
#include "core/ingest/lidar_packet.hpp"
#include "core/ingest/point_filters.hpp"
#include "core/ingest/ring_segments.hpp"
#include "core/ingest/scan_normals.hpp"
#include "core/ingest/sweep.hpp"
#include "core/sources/motion_sources.hpp"

namespace locus {

/// Measures the time of one revolution from stamps and azimuths of the packets, at any speed of rotation. One owner.
class RevolutionTimer {
 public:
  void observe(const LidarPacket& packet);
  [[nodiscard]] Duration period() const;

 private:
  std::optional<std::uint8_t> lidar_; ///< the first one heard of lowest index
  Stamp last_stamp_;
  std::uint16_t last_azimuth_cdeg_ = 0;
  double azimuth_sum_cdeg_ = 0.0;
  double time_sum_s_ = 0.0;
};

/// Turns packets into sweeps: motion correction, merger and filters (paper II-A), done while the sweep is still coming
/// in.
///
/// A sweep is a window of time over all lidars, so they need no phase lock and a dead one is simply not there. Where
/// the only lidar gives whole clouds and no period is set, a window ends with each cloud, for nothing more comes until
/// the next. Each packet is moved to where the base was at the start of the window, with one linear map per packet; at
/// the cut the whole is moved to its end. What no motion source could correct keeps its time of firing, for Odometry to
/// correct. Memory is fixed after the first sweeps. One owner.
class SweepBuilder {
 public:
  /// Takes a finished sweep; may swap its points for another vector of the same use.
  using Sink = std::function<void(Sweep&)>;

  struct Counters {
    std::uint64_t late_packets = 0;      ///< older than the window by more than kMaxLateness: left out
    std::uint64_t restarts = 0;          ///< time had jumped; the windows began anew
    std::uint64_t overflowed_points = 0; ///< more than fit into memory: left out
  };

  static constexpr Duration kGrace = std::chrono::milliseconds{2}; ///< after the nominal end, when no packet comes
  static constexpr Duration kMaxLateness = std::chrono::milliseconds{50};

  /// `T_base_lidar` by lidar index; `max_returns` in one sweep of all lidars.
  SweepBuilder(const SweepOptions& options, std::vector<Pose> T_base_lidar, MotionSources sources,
               std::size_t max_returns, Sink sink, StageClock* clock = nullptr);

  [[nodiscard]] MotionSources& sources() { return sources_; }
  [[nodiscard]] const MotionSources& sources() const { return sources_; }

  /// `arrival` is when the packet reached this computer.
  void add(const LidarPacket& packet, Stamp arrival);

  /// Tells the time, in stamps of arrival: closes windows that have ended without a packet to close them.
  void advance(Stamp now);

  /// The input has ended: the last partial window counts if it is longer than half a period.
  void finish();

  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Window {
    Window(Stamp start_, Stamp end_) : start(start_), end(end_), last_firing(start_), anchor(start_), placed(start_) {}
    Stamp start, end;
    Uncorrected uncorrected = Uncorrected::all; ///< decided at the start
    SourceChoice choice;                        ///< of those that go on being healthy
    Stamp last_firing;
    Stamp anchor; ///< since when the sources of the choice have been followed
    Pose T_start_anchor;
    Stamp placed; ///< the latest instant whose pose is known
    Pose T_start_placed;
  };
  struct RawPoint {
    SweepPoint point;
    std::uint32_t segment;
  };

  void open(Stamp start);
  void end_with(const LidarPacket::Cloud& cloud);
  void close();
  void append(const LidarPacket& packet, Stamp from, Stamp to);
  void reduce(float duration_s);
  void take_singly(float duration_s);
  void choose_registered();
  void move_to_end();
  [[nodiscard]] Pose T_start_base(Stamp stamp);
  void note_place(Stamp stamp, const Pose& T_start_base);
  [[nodiscard]] std::optional<Pose> follow_sources(Stamp stamp) const;
  void hand_over(Stamp now);
  [[nodiscard]] Duration period() const;
  [[nodiscard]] PacketMotion motion_of(const LidarPacket& packet);
  void leave_out_body(const Pose& T_base_lidar, const FiringGroup& group, RingSegments::Mask& counts) const;
  [[nodiscard]] bool keeps_singly() const;
  void keep_singly(std::size_t lidar, const FiringGroup& group, const RingSegments::Mask& counts,
                   const PacketMotion& motion);

  SweepOptions options_;
  std::vector<Pose> T_base_lidar_;
  bool may_follow_clouds_; ///< one lidar, and no period is set
  MotionSources sources_;
  Sink sink_;
  StageClock* clock_;
  std::size_t max_returns_;
  RevolutionTimer revolution_;
  RingSegments segments_;
  ScanNormals normals_;
  VoxelFilter voxel_filter_;
  RandomFilter random_filter_;
  std::optional<Window> window_;
  Vector6 last_twist_base_ = Vector6::Zero(); ///< over the last window, after its sources
  std::vector<RawPoint> raw_;                 ///< only where returns are kept singly
  Sweep sweep_;
  std::vector<SweepPoint> unregistered_;
  Duration lag_{}; ///< of arrival behind firing, as last seen
  std::uint64_t consecutive_late_ = 0;
  Stamp late_since_; ///< arrival of the first of them
  Counters counters_;
};

} // namespace locus
