// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bags/mcap_writer.hpp"
#include "config/config.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/figures.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/sweep_processor.hpp"

namespace locus::tools {

/// Writes the service's output for a run to one MCAP file for Foxglove and rosbag2: odometry, tf and de-skewed cloud of
/// each sweep, and diagnostics once per second of the recording; and the samples of the motion sources as received,
/// with where the IMUs sit on /tf_static. Topics and frames are as configured; a source without a topic has /NAME, an
/// IMU the frame NAME. One owner.
class McapResults {
 public:
  /// `config` must outlive this. Throws Failure, as does close().
  McapResults(const std::filesystem::path& file, const Config& config);

  /// Writes a motion sample. Ignores other inputs.
  void add(const daemon::Input& input);
  /// Writes a sweep. Call right after it was processed.
  void add(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done);
  /// Writes diagnostics, if due.
  void add(const daemon::Ingest& ingest, const daemon::SweepCounters& counters);
  void close() { writer_.close(); }

 private:
  template <class Message> std::uint16_t add_topic(const std::string& topic);
  template <class Message> void write(std::uint16_t channel, Stamp stamp, const Message& message);
  void write_mountings(Stamp stamp);

  const Config& config_;
  daemon::FrameNames frames_;
  McapWriter writer_;
  std::uint16_t odometry_, tf_, static_tf_, cloud_, diagnostics_;
  std::vector<std::uint16_t> sources_; ///< channels of the motion sources, by configuration index
  bool has_mountings_ = false;
  Stamp now_, diagnosed_; ///< end of the latest sweep; time of the latest diagnostics
  daemon::SweepStatistics tally_;
  daemon::CloudMessage cloud_message_;
  std::vector<daemon::CloudMessage::Point> points_;
  std::vector<std::byte> serialised_;
};

} // namespace locus::tools
