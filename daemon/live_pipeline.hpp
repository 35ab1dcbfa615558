// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>

#include "config/config.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/fast_odometry.hpp"
#include "daemon/figures.hpp"
#include "daemon/ingest.hpp"
#include "daemon/input.hpp"
#include "daemon/machine_time.hpp"
#include "daemon/sweep_processor.hpp"
#include "daemon/threads.hpp"

namespace locus::daemon {

/// How the live threads are set up, beside their configuration.
struct LiveOptions {
  double speed = 1.0; ///< by how much the stamps of the input run faster than the clock on the wall; 1 if it is live
  std::optional<StartPoint> start{}; ///< nothing: level at the origin
  Recalled recalled{};
  std::function<void()> on_thread_start = [] {}; ///< in each of the threads, e.g. to set its priority
  /// In the odometry thread, after the estimate has left: for clouds, maps and what is to be saved.
  std::function<void(const Sweep&, const Odometry&, const OdometryEstimate&)> after_estimate{};
};

/// The live threads: ingest turns inputs into sweeps, odometry turns the newest sweep into an estimate.
///
/// Between the two is a LatestSlot: a sweep that was not taken when the next one is ready is dropped and counted, so
/// under overload the estimates get fewer, never older. The registration of a sweep is ended one period after its cut.
/// Estimates leave through a ring; who does not fetch them loses them and delays nobody. On the way from input to
/// estimate no lock is taken and, once the first sweeps have bought the memory, the ingest allocates nothing. Every
/// wait has a timeout.
///
/// One owner, who may be the consumer too.
class LivePipeline { // NOLINT(clang-analyzer-optin.performance.Padding): it keeps the threads' data apart
 public:
  static constexpr std::size_t kMaxUnfetched = 64;

  /// Starts both threads. `lidars` opened from config.lidars; `input` must outlive this, and is used by the ingest
  /// thread alone.
  LivePipeline(const Config& config, LidarRouter lidars, InputSource& input, LiveOptions options = {});
  ~LivePipeline() { stop(); }
  LivePipeline(const LivePipeline&) = delete;
  LivePipeline& operator=(const LivePipeline&) = delete;

  /// Consumer: the next estimate; nothing if there is none within `timeout`, or a fast sample sooner.
  std::optional<ProcessedSweep> next(Duration timeout);

  /// Consumer: the next estimate carried forward; call it as long as there is one.
  std::optional<FastSample> next_fast() { return fast_samples_.pop(); }

  /// Consumer: what the ingest has counted, ten times a second; nullptr when nothing new is there.
  const IngestReport* next_report() { return reports_.take(); }

  /// Consumer: the next change of health of a motion source.
  std::optional<HealthEvent> next_health_event() { return health_events_.pop(); }

  /// Consumer: whether all has been fetched and nothing more can come, for the input has ended or stop() was called.
  [[nodiscard]] bool finished() const;

  /// Owner: ends both threads, within an iteration of the registration and one wait for input. What has been seen is
  /// accounted for afterwards. May be called again.
  void stop();

  /// Any thread: from the next sweep on.
  void set_flat_ground(FlatGround mode) { flat_ground_.store(mode, std::memory_order_relaxed); }

  /// Any thread. Each number grows as long as its thread lives, whether or not sensors do.
  struct Progress {
    std::uint64_t ingest, odometry;
    bool operator==(const Progress&) const = default;
  };
  [[nodiscard]] Progress progress() const {
    return {ingest_progress_.load(std::memory_order_relaxed), odometry_progress_.load(std::memory_order_relaxed)};
  }

  /// Any thread. Of a sweep that counts as processed or failed, the estimate is there to be fetched, and the ingest has
  /// its feedback with the next.
  [[nodiscard]] SweepCounters counters() const;
  /// Estimates and changes of health that nobody fetched in time.
  [[nodiscard]] std::uint64_t unfetched() const { return unfetched_.load(std::memory_order_relaxed); }

  /// Owner, after stop().
  [[nodiscard]] const Ingest& ingest() const { return ingest_; }
  [[nodiscard]] const SweepProcessor& processor() const { return processor_; }

 private:
  struct CutSweep {
    Sweep sweep;
    SweepCut cut;
  };
  using Counter = std::atomic<std::uint64_t>; ///< any thread may read

  void run_ingest();
  void run_odometry();
  void carry_forward(const Input& input);
  void report();
  void hand_over(Sweep& sweep, const SweepCut& cut);
  void process(const CutSweep& taken);

  InputSource& input_;
  LiveOptions options_;
  std::size_t max_points_;
  Ingest ingest_;
  SweepProcessor processor_;

  LatestSlot<CutSweep> newest_sweep_;
  Wakeup sweep_is_there_;
  SpscRing<ProcessedSweep, kMaxUnfetched> estimates_;
  SpscRing<HealthEvent, kMaxUnfetched> health_events_; ///< ingest -> consumer
  SpscRing<RegistrationFeedback, 4> feedback_;         ///< odometry -> ingest
  SpscRing<FastSample, 4> anchors_;                    ///< odometry -> ingest: what is carried forward
  FastOdometry fast_odometry_;                         ///< of ingest
  SpscRing<FastSample, kMaxUnfetched> fast_samples_;   ///< ingest -> consumer
  LatestSlot<IngestReport> reports_;                   ///< ingest -> consumer
  Duration reported_{};                                ///< of ingest
  Wakeup estimate_is_there_;

  Counter seen_{0}, dropped_{0};     ///< by ingest
  Counter processed_{0}, failed_{0}; ///< by odometry
  Counter unfetched_{0};             ///< by both
  Counter ingest_progress_{0}, odometry_progress_{0};
  std::atomic<FlatGround> flat_ground_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> ingest_ended_{false};
  std::atomic<bool> odometry_ended_{false};
  std::thread ingest_thread_;
  std::thread odometry_thread_;
};

} // namespace locus::daemon
