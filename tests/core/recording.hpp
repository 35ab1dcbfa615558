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

/// Data packets of one lidar, held in memory to be played again and again without the cost of making or reading them.
class Recording {
 public:
  Recording(Recording&&) = default;
  Recording& operator=(Recording&&) = default;
  static Recording synthetic(const sim::Scene& scene, const sim::Trajectory& trajectory,
                             const sim::SyntheticLidarOptions& lidar, Duration duration);

  /// Of `velodyne/<name>.pcap` in the folder of real captures; nothing where it is absent.
  static std::optional<Recording> real(const std::string& name);

  [[nodiscard]] const std::vector<Datagram>& datagrams() const { return datagrams_; }

 private:
  Recording() = default;
  void keep(const Datagram& datagram);

  std::deque<std::vector<std::byte>> payloads_; ///< never moves what it holds
  std::vector<Datagram> datagrams_;
};

/// A VLP-16 at 10 Hz with 2 cm of noise, driven through sim::plant() at 1 m/s.
Recording plant_recording(Duration duration);

/// From the datagrams of a recording to sweeps, as in the daemon: decoder, clock, builder; no motion source.
class SweepsOfRecording {
 public:
  /// The recording must outlive it.
  SweepsOfRecording(const Recording& recording, const SweepOptions& options, StageClock* clock = nullptr);

  /// The next sweep, valid until the next call; nullptr at the end.
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

/// All sweeps of a recording.
std::vector<Sweep> sweeps_of(const Recording& recording, const SweepOptions& options);

/// Every return on its own, as other registrations want them.
SweepOptions every_return();

} // namespace locus::test
