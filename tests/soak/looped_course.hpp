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

/// What a robot's sensors say that drives a closed course lap after lap: stamps, the lidar's clock and the wheels'
/// odometry go on from one to the next.
///
/// Between the laps, and where it is told to pause, it is at rest: it says Silence until it is told to go on. One
/// thread asks for input; whatever is for the owner, may be called while it is at rest or nobody asks.
class LoopedCourse : public daemon::InputSource {
 public:
  /// What was given out so far.
  struct Given {
    std::uint64_t datagrams = 0;
    std::array<std::uint64_t, kMaxSources> samples{}; ///< by index of the motion source
  };

  /// Begins with the lap of this number, at rest.
  LoopedCourse(ClosedCourse course, const Config& config, std::uint64_t lap);
  ~LoopedCourse() override;

  daemon::Input next(Duration timeout) override;

  /// Any thread.
  [[nodiscard]] bool is_at_rest() const { return at_rest_.load(std::memory_order_acquire); }

  /// Owner: on the next lap, with a pause so long after its beginning; none where that is longer than the lap.
  void begin_lap(const std::vector<Fault>& faults, Duration until_pause = Duration::max());
  /// Owner: after the pause.
  void go_on() { at_rest_.store(false, std::memory_order_release); }
  /// Owner: so long nobody hears what the sensors say.
  void miss(Duration duration);
  [[nodiscard]] Stamp now() const { return now_; }
  /// Owner: since the beginning, that of the lap that runs or is to be begun.
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
  Stamp heard_from_;              ///< what arrives before is missed
  std::vector<Pose> T_begin_end_; ///< of a lap, by index of the motion source, as odometry has it
  std::vector<Pose> T_source_lap_;
  std::unique_ptr<tools::Recording> recording_;
  std::vector<std::byte> payload_;
  Given given_;
  std::atomic<bool> at_rest_{true};
};

} // namespace locus::soak
