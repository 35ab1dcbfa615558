// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/recording.hpp"
#include "daemon/input.hpp"
#include "pipeline.hpp"
#include "simulated_robot.hpp"

namespace locus::performance {

/// What reached the computer of a robot, held in memory to be played again and again without the cost of making or
/// reading it.
class Capture {
 public:
  /// Of lidar alone.
  Capture(std::string name, test::Recording recording);
  /// All that the robot sees on its drive.
  Capture(std::string name, SimulatedRobot& robot);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::vector<daemon::Input>& inputs() const { return inputs_; }
  [[nodiscard]] bool has_motion_sources() const { return !config_.motion_sources.empty(); }

  /// One thread, all motion sources.
  [[nodiscard]] const Config& config() const { return config_; }
  /// One thread, lidar alone.
  [[nodiscard]] Config config_of_lidar_alone() const;

 private:
  std::string name_;
  Config config_;
  std::optional<test::Recording> recording_;
  std::deque<std::vector<std::byte>> payloads_; ///< never moves what it holds
  std::vector<daemon::Input> inputs_;
};

/// Plays a capture through a pipeline. One owner.
class Playback {
 public:
  /// The capture must outlive it.
  Playback(const Capture& capture, const Config& config) : inputs_(capture.inputs()), pipeline_(config) {}

  /// Plays until a sweep has been processed, valid until the next call; nullptr at the end of the capture.
  const daemon::ProcessedSweep* next() {
    while (played_ < inputs_.size())
      if (const daemon::ProcessedSweep* sweep = pipeline_.take(inputs_[played_++]))
        return sweep;
    return nullptr;
  }
  [[nodiscard]] const Pipeline& pipeline() const { return pipeline_; }

 private:
  const std::vector<daemon::Input>& inputs_;
  std::size_t played_ = 0;
  Pipeline pipeline_;
};

} // namespace locus::performance
