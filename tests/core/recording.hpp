// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/ingest/sweep.hpp"
#include "core/ingest/sweep_builder.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "drivers/lidar_input.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_sim/synthetic_lidar.hpp"

namespace locus::test {

/// Data packets of one lidar in memory, replayed repeatedly without the cost of simulating or reading them.
class Recording {
 public:
  Recording(Recording&&) = default;
  Recording& operator=(Recording&&) = default;
  static Recording synthetic(const sim::Scene& scene, const sim::Trajectory& trajectory,
                             const sim::SyntheticLidarOptions& lidar, Duration duration);

  /// Reads `velodyne/<name>.pcap` of the folder of real captures; nothing if it is absent.
  static std::optional<Recording> real(const std::string& name);

  [[nodiscard]] const std::vector<Datagram>& datagrams() const { return datagrams_; }

 private:
  Recording() = default;
  void keep(const Datagram& datagram);

  std::deque<std::vector<std::byte>> payloads_; ///< a deque: addresses stay valid
  std::vector<Datagram> datagrams_;
};

/// Simulates a VLP-16 at 10 Hz with 2 cm of range noise, driven through sim::plant() at 1 m/s.
Recording plant_recording(Duration duration);

/// Turns the datagrams of a recording into sweeps, as in the daemon: decoder, clock, builder; no motion source.
class SweepsOfRecording {
 public:
  /// `recording` must outlive this.
  SweepsOfRecording(const Recording& recording, const SweepOptions& options, StageClock* clock = nullptr);

  /// Returns the next sweep, valid until the next call; nullptr at the end.
  Sweep* next();

 private:
  const LidarPacket* decode(const Datagram& datagram);

  const Recording& recording_;
  StageClock* clock_;
  LidarInput lidar_;
  std::size_t played_ = 0;
  bool ready_ = false;
  bool finished_ = false;
  Sweep sweep_;
  SweepBuilder builder_;
};

/// Returns all sweeps of a recording.
std::vector<Sweep> sweeps_of(const Recording& recording, const SweepOptions& options);

/// Options that keep every return, as other registrations expect.
SweepOptions every_return();

} // namespace locus::test
