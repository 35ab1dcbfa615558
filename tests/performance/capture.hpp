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

/// Inputs of a robot's computer in memory, replayed repeatedly without the cost of simulating or reading them.
class Capture {
 public:
  /// Lidar only.
  Capture(std::string name, test::Recording recording);
  /// All inputs of the simulated drive.
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
  std::deque<std::vector<std::byte>> payloads_; ///< a deque: addresses stay valid
  std::vector<daemon::Input> inputs_;
};

/// Plays a capture through a pipeline. Not thread-safe.
class Playback {
 public:
  /// `capture` must outlive this.
  Playback(const Capture& capture, const Config& config) : inputs_(capture.inputs()), pipeline_(config) {}

  /// Plays until a sweep is processed and returns it, valid until the next call; nullptr at the end of the capture.
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
