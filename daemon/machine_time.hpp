// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <ctime>

#include "core/base/stage_clock.hpp"
#include "core/base/stamp.hpp"

namespace locus::daemon {

/// Reads one of the system's clocks, e.g. CLOCK_MONOTONIC. Any thread.
inline Duration read_clock(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return std::chrono::seconds{now.tv_sec} + Duration{now.tv_nsec};
}

inline timespec to_timespec(Duration duration) noexcept {
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(duration);
  return {static_cast<time_t>(whole.count()), static_cast<long>((duration - whole).count())};
}

/// Wall and CPU time, as an instant or a difference. Used to measure cost and pace threads; measurements use Stamp.
struct MachineTime {
  Duration wall{}; ///< CLOCK_MONOTONIC
  Duration cpu{};  ///< all threads of the process, including the odometry's helpers

  static MachineTime now() noexcept { return {read_clock(CLOCK_MONOTONIC), read_clock(CLOCK_PROCESS_CPUTIME_ID)}; }
  friend MachineTime operator-(const MachineTime& a, const MachineTime& b) { return {a.wall - b.wall, a.cpu - b.cpu}; }
};

/// CPU time by Stage.
using StageTimes = std::array<Duration, kStages>;

/// Accumulates the CPU time that its thread spends in each stage; an inner stage is not charged to the outer one.
///
/// Reading the thread clock is a system call that costs as much as decoding a packet. In the per-packet stages only one
/// visit in kSampling is timed and extrapolated, and the cost of the reading itself is subtracted. One owner; a stage
/// ends on the thread that it began on.
class StageStopwatch : public StageClock {
 public:
  static constexpr std::uint64_t kSampling = 13; ///< prime, since packets are periodic with the revolution

  using Clock = Duration (*)(clockid_t); ///< read_clock(), replaceable in tests
  explicit StageStopwatch(Clock clock = [](clockid_t id) { return read_clock(id); });

  void enter(Stage stage) override { enter(static_cast<std::size_t>(stage)); }
  void leave() override;

  /// Returns the CPU time spent in `stage` so far.
  [[nodiscard]] Duration total(Stage stage) const;
  /// Returns the CPU time spent in each stage since the last call.
  StageTimes lap();

  /// Excludes the time during its lifetime from all open stages.
  class Pause {
   public:
    explicit Pause(StageStopwatch& stopwatch) : stopwatch_(stopwatch) { stopwatch_.enter(kOutside); }
    ~Pause() { stopwatch_.leave(); }
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;

   private:
    StageStopwatch& stopwatch_;
  };

 private:
  static constexpr std::size_t kOutside = kStages;
  static constexpr std::size_t kMaxDepth = 8;
  struct Frame {
    std::size_t stage;
    bool timed;
  };

  void enter(std::size_t stage);
  void charge_innermost();

  Clock clock_;
  Duration reading_cost_{};
  Duration mark_{}; ///< thread CPU time charged so far
  std::array<Duration, kStages + 1> totals_{};
  std::array<std::uint64_t, kStages + 1> visits_{};
  StageTimes totals_at_lap_{};
  std::array<Frame, kMaxDepth> open_{};
  std::size_t depth_ = 0;
};

/// Cost data that accompanies a sweep from its cut to its processing.
struct SweepCut {
  MachineTime start;        ///< start of the work on the cut
  StageTimes ingest_took{}; ///< since the previous cut
};

} // namespace locus::daemon
