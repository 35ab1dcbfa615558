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

/// Options of the live threads, in addition to the configuration.
struct LiveOptions {
  double speed = 1.0;                ///< rate of the input stamps relative to real time; 1 for live input
  std::optional<StartPoint> start{}; ///< empty: level at the origin
  EarlierCalibration calibration{};
  std::function<void()> on_thread_start = [] {}; ///< called in each thread, e.g. to set its priority
  /// Called in the odometry thread after the estimate was handed over, for clouds, maps and the saved state.
  std::function<void(const Sweep&, const Odometry&, const OdometryEstimate&)> after_estimate{};
};

/// The live threads: ingest turns inputs into sweeps, odometry turns the newest sweep into an estimate.
///
/// A LatestSlot connects the two: a sweep not consumed when the next is ready is dropped and counted, so overload makes
/// estimates rarer, never older. Registration of a sweep stops one period after its cut. Estimates leave through a
/// ring; a slow consumer loses estimates and delays no thread. The path from input to estimate takes no lock, and the
/// ingest allocates nothing after the first few sweeps. Every wait has a timeout.
///
/// One owner, which may also be the consumer.
class LivePipeline { // NOLINT(clang-analyzer-optin.performance.Padding): it avoids false sharing
 public:
  static constexpr std::size_t kMaxUnfetched = 64;

  /// Starts both threads. `lidars` are opened from config.lidars; `input` must outlive this and is used by the ingest
  /// thread only.
  LivePipeline(const Config& config, LidarRouter lidars, InputSource& input, LiveOptions options = {});
  ~LivePipeline() { stop(); }
  LivePipeline(const LivePipeline&) = delete;
  LivePipeline& operator=(const LivePipeline&) = delete;

  /// Consumer: returns the next estimate; empty if there is none within `timeout` or when a fast sample arrives sooner.
  std::optional<ProcessedSweep> next(Duration timeout);

  /// Consumer: returns the next fast sample; call until empty.
  std::optional<FastSample> next_fast() { return fast_samples_.pop(); }

  /// Consumer: returns the ingest's counters, ten times a second; nullptr if there is no new report.
  const IngestReport* next_report() { return reports_.poll(); }

  /// Consumer: returns the next change of health of a motion source.
  std::optional<HealthEvent> next_health_event() { return health_events_.pop(); }

  /// Consumer: true once the input has ended or stop() was called, and all estimates are fetched.
  [[nodiscard]] bool finished() const;

  /// Owner: stops both threads, within one registration iteration and one wait for input. Every sweep then counts as
  /// processed, dropped or failed. Idempotent.
  void stop();

  /// Any thread: sets the mode from the next sweep on.
  void set_flat_ground(FlatGround mode) { flat_ground_.store(mode, std::memory_order_relaxed); }

  /// Any thread: heartbeats of the threads; each grows while its thread runs, with or without sensor data.
  struct Progress {
    std::uint64_t ingest, odometry;
    bool operator==(const Progress&) const = default;
  };
  [[nodiscard]] Progress progress() const {
    return {ingest_progress_.load(std::memory_order_relaxed), odometry_progress_.load(std::memory_order_relaxed)};
  }

  /// Any thread: returns the counters. Once a sweep counts as processed or failed, its estimate can be fetched and its
  /// feedback reaches the ingest with the next sweep.
  [[nodiscard]] SweepCounters counters() const;
  /// Any thread: estimates and health changes lost because they were not fetched in time.
  [[nodiscard]] std::uint64_t unfetched() const { return unfetched_.load(std::memory_order_relaxed); }

  /// Owner, after stop(): access to the stages.
  [[nodiscard]] const Ingest& ingest() const { return ingest_; }
  [[nodiscard]] const SweepProcessor& processor() const { return processor_; }

 private:
  struct CutSweep {
    Sweep sweep;
    SweepCut cut;
  };
  using Counter = std::atomic<std::uint64_t>; ///< readable from any thread

  void run_ingest();
  void run_odometry();
  void publish_fast_sample(const Input& input);
  void publish_report();
  void hand_over(Sweep& sweep, const SweepCut& cut);
  void process(const CutSweep& cut_sweep);

  InputSource& input_;
  LiveOptions options_;
  std::size_t max_points_;
  Ingest ingest_;
  SweepProcessor processor_;

  LatestSlot<CutSweep> newest_sweep_;
  Wakeup sweep_ready_;
  SpscRing<ProcessedSweep, kMaxUnfetched> estimates_;
  SpscRing<HealthEvent, kMaxUnfetched> health_events_; ///< ingest -> consumer
  SpscRing<RegistrationFeedback, 4> feedback_;         ///< odometry -> ingest
  SpscRing<FastSample, 4> estimates_to_propagate_;     ///< odometry -> ingest: estimates to propagate
  FastOdometry fast_odometry_;                         ///< owned by the ingest
  SpscRing<FastSample, kMaxUnfetched> fast_samples_;   ///< ingest -> consumer
  LatestSlot<IngestReport> reports_;                   ///< ingest -> consumer
  Duration reported_{};                                ///< owned by the ingest
  Wakeup estimate_ready_;

  Counter seen_{0}, dropped_{0};     ///< written by ingest
  Counter processed_{0}, failed_{0}; ///< written by odometry
  Counter unfetched_{0};             ///< written by both
  Counter ingest_progress_{0}, odometry_progress_{0};
  std::atomic<FlatGround> flat_ground_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> ingest_ended_{false};
  std::atomic<bool> odometry_ended_{false};
  std::thread ingest_thread_;
  std::thread odometry_thread_;
};

} // namespace locus::daemon
