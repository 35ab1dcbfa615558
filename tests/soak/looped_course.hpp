// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "closed_course.hpp"
#include "config/config.hpp"
#include "core/base/pose.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/input.hpp"
#include "faults/fault.hpp"

namespace locus::tools {
class Recording;
}

namespace locus::soak {

/// Sensor data of a robot that drives a closed course lap after lap, with continuous stamps, lidar clock and wheel
/// odometry.
///
/// Between laps and during a pause it is at rest and returns Silence until it is resumed. One thread calls next();
/// functions marked "owner" may be called only while it is at rest or no thread calls next().
class LoopedCourse : public daemon::InputSource {
 public:
  /// Inputs returned so far.
  struct Given {
    std::uint64_t datagrams = 0;
    std::array<std::uint64_t, kMaxSources> samples{}; ///< by index of the motion source
  };

  /// Starts at rest, before the lap of this number.
  LoopedCourse(ClosedCourse course, const Config& config, std::uint64_t lap);
  ~LoopedCourse() override;

  daemon::Input next(Duration timeout) override;

  /// Any thread.
  [[nodiscard]] bool is_at_rest() const { return at_rest_.load(std::memory_order_acquire); }

  /// Owner: starts the next lap, with a pause after `until_pause`; none if that is longer than the lap.
  void begin_lap(const std::vector<Fault>& faults, Duration until_pause = Duration::max());
  /// Owner: resumes after the pause.
  void go_on() { at_rest_.store(false, std::memory_order_release); }
  /// Owner: drops all inputs of this duration.
  void miss(Duration duration);
  [[nodiscard]] Stamp now() const { return now_; }
  /// Owner: time from the first lap to the current or next one.
  [[nodiscard]] Duration offset() const { return offset_; }
  [[nodiscard]] const Given& given() const { return given_; }

 private:
  daemon::Input carry_forward(const daemon::Input& input);
  void end_lap();
  [[nodiscard]] bool is_of_next_lap(const daemon::Input& input) const;
  void count(const daemon::Input& input);
  void learn_wheels();

  ClosedCourse course_;
  Config config_;
  Stamp start_;     ///< of the first lap
  Duration offset_; ///< of this lap
  Stamp now_;
  Stamp pause_at_ = Stamp::max();
  Stamp heard_from_;              ///< earlier inputs are dropped
  std::vector<Pose> T_begin_end_; ///< motion over a lap by the odometry, by index of the motion source
  std::vector<Pose> T_source_lap_;
  std::unique_ptr<tools::Recording> recording_;
  std::vector<std::byte> payload_;
  Given given_;
  std::atomic<bool> at_rest_{true};
};

} // namespace locus::soak
