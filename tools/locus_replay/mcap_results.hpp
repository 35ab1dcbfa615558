// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "config/config.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "daemon/figures.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/sweep_processor.hpp"
#include "locus_replay/mcap_inputs.hpp"
#include "locus_replay/mcap_messages.hpp"

namespace locus::tools {

/// Writes the service's output for a run to one MCAP file for Foxglove and rosbag2: odometry, tf and de-skewed cloud of
/// each sweep, and diagnostics once per second of the recording; and the inputs, see McapInputs. Topics and frames are
/// as configured. One owner.
class McapResults {
 public:
  /// `config` must outlive this. Throws Failure, as does close().
  McapResults(const std::filesystem::path& file, const Config& config);

  /// Writes an input after it was processed by `lidars`.
  void add(const daemon::Input& input, const LidarRouter& lidars) { inputs_.add(input, lidars); }
  /// Writes a sweep. Call right after it was processed.
  void add(const Sweep& sweep, const Odometry& odometry, const daemon::ProcessedSweep& done);
  /// Writes diagnostics, if due.
  void add(const daemon::Ingest& ingest, const daemon::SweepCounters& counters);
  void close() { messages_.close(); }

 private:
  const Config& config_;
  daemon::FrameNames frames_;
  McapMessages messages_;
  McapInputs inputs_;
  std::uint16_t odometry_, tf_, cloud_, diagnostics_;
  Stamp now_, diagnosed_; ///< end of the latest sweep; time of the latest diagnostics
  daemon::SweepStatistics tally_;
  daemon::CloudMessage cloud_message_;
  std::vector<daemon::CloudMessage::Point> points_;
};

} // namespace locus::tools
