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

/// Measures the revolution time from stamps and azimuths of the packets, at any speed of rotation. One owner.
class RevolutionTimer {
 public:
  void observe(const LidarPacket& packet);
  [[nodiscard]] Duration period() const;

 private:
  std::optional<std::uint8_t> lidar_; ///< received lidar of lowest index
  Stamp last_stamp_;
  std::uint16_t last_azimuth_cdeg_ = 0;
  double azimuth_sum_cdeg_ = 0.0;
  double time_sum_s_ = 0.0;
};

/// Turns packets into sweeps: motion correction, merging and filters (paper II-A), done while the sweep is still
/// arriving.
///
/// A sweep is a time window over all lidars, so they need no phase lock and a failed one is simply missing. If the only
/// lidar sends whole clouds and no period is configured, a window ends with each cloud, since nothing more arrives
/// before the next. Each packet is transformed to the base at the start of the window, with one linear map per packet;
/// at the cut all points are transformed to its end. Motion that no source measured is left to Odometry to correct, by
/// the age of the points. Memory is fixed after the first sweeps. One owner.
class SweepBuilder {
 public:
  /// Receives a finished sweep; may swap its point vectors for others, to reuse memory.
  using Sink = std::function<void(Sweep&)>;

  struct Counters {
    std::uint64_t late_packets = 0;      ///< dropped: older than the window by more than kMaxLateness
    std::uint64_t restarts = 0;          ///< time jumped and the windows were restarted
    std::uint64_t overflowed_points = 0; ///< dropped for lack of memory
  };

  static constexpr Duration kGrace = std::chrono::milliseconds{2}; ///< after the nominal end, if no packet arrives
  static constexpr Duration kMaxLateness = std::chrono::milliseconds{50};

  /// `T_base_lidar` is indexed by lidar; `max_returns` is the most in one sweep of all lidars.
  SweepBuilder(const SweepOptions& options, std::vector<Pose> T_base_lidar, MotionSources sources,
               std::size_t max_returns, Sink sink, StageClock* clock = nullptr);

  [[nodiscard]] MotionSources& sources() { return sources_; }
  [[nodiscard]] const MotionSources& sources() const { return sources_; }

  /// Adds a packet; `arrival` is when it reached this computer.
  void add(const LidarPacket& packet, Stamp arrival);

  /// Sets the time, in stamps of arrival: closes windows that have ended without a packet to close them.
  void advance(Stamp now);

  /// Ends the input: the last partial window is passed on if it is longer than half a period.
  void finish();

  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Window {
    Window(Stamp start_, Stamp end_) : start(start_), end(end_), last_firing(start_), anchor(start_), placed(start_) {}
    Stamp start, end;
    Uncorrected uncorrected = Uncorrected::all; ///< decided at the start
    SourceChoice choice;                        ///< of sources that are still healthy
    Stamp last_firing;
    Stamp anchor; ///< start of the motion measured by the sources of the choice
    Pose T_start_anchor;
    Stamp placed; ///< latest instant with a known pose
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
  void copy_returns(float duration_s);
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
  bool may_follow_clouds_; ///< one lidar, and no period configured
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
  Vector6 last_twist_base_ = Vector6::Zero(); ///< over the last window, from its sources
  std::vector<RawPoint> raw_;                 ///< used only if individual returns are stored
  Sweep sweep_;
  std::vector<SweepPoint> unregistered_;
  Duration lag_{}; ///< latest delay of arrival after firing
  std::uint64_t consecutive_late_ = 0;
  Stamp late_since_; ///< arrival of the first of these
  Counters counters_;
};

} // namespace locus
