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

/// What the machine spends, as an instant or as the difference of two. It measures cost and paces threads; the time of
/// measurements is Stamp.
struct MachineTime {
  Duration wall{}; ///< CLOCK_MONOTONIC
  Duration cpu{};  ///< of all threads of the process: the odometry's helpers count

  static MachineTime now() noexcept { return {read_clock(CLOCK_MONOTONIC), read_clock(CLOCK_PROCESS_CPUTIME_ID)}; }
  friend MachineTime operator-(const MachineTime& a, const MachineTime& b) { return {a.wall - b.wall, a.cpu - b.cpu}; }
};

/// CPU time by stage.
using StageTimes = std::array<Duration, kStages>;

/// Adds up the CPU time that its thread spends in each stage; the time of an inner stage is not charged to the outer.
///
/// Reading the clock of a thread is a system call, as long as the decoding of a packet. So of the stages that every
/// packet goes through only one visit in kSampling is timed, and counts for all; and what the reading itself costs is
/// taken off. One owner, and a stage ends on the thread that it began on.
class StageStopwatch : public StageClock {
 public:
  static constexpr std::uint64_t kSampling = 13; ///< a prime, for packets come in rhythm with the revolution

  using Clock = Duration (*)(clockid_t); ///< read_clock(), or another in tests
  explicit StageStopwatch(Clock clock = [](clockid_t id) { return read_clock(id); });

  void enter(Stage stage) override { enter(static_cast<std::size_t>(stage)); }
  void leave() override;

  /// CPU time spent in `stage` so far.
  [[nodiscard]] Duration total(Stage stage) const;
  /// CPU time spent in each stage since the last call.
  StageTimes lap();

  /// What is done in the life of this object belongs to none of the stages that are open.
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
  Duration mark_{}; ///< up to here everything is charged
  std::array<Duration, kStages + 1> totals_{};
  std::array<std::uint64_t, kStages + 1> visits_{};
  StageTimes totals_at_lap_{};
  std::array<Frame, kMaxDepth> open_{};
  std::size_t depth_ = 0;
};

/// What goes with a sweep from where it was cut to where it is processed, to tell what it costs.
struct SweepCut {
  MachineTime began;        ///< when the work on the cut began
  StageTimes ingest_took{}; ///< since the cut before
};

} // namespace locus::daemon
