// SPDX-License-Identifier: Apache-2.0
#include "daemon/live_pipeline.hpp"

#include <ctime>
#include <utility>
#include <variant>
#include <vector>

#include <pthread.h>

namespace locus::daemon {

namespace {

/// Longest delay before a window without a closing packet is closed.
constexpr Duration kMaxSilence = std::chrono::milliseconds{2};

/// Longest sleep of a thread between two checks of its stop flag.
constexpr Duration kMaxSleep = std::chrono::milliseconds{100};

} // namespace

LivePipeline::LivePipeline(const Config& config, LidarRouter lidars, InputSource& input, LiveOptions options)
    : input_(input), options_(std::move(options)), max_points_(Ingest::max_points(config)),
      ingest_(
          config, std::move(lidars), [this](Sweep& sweep, const SweepCut& cut) { hand_over(sweep, cut); },
          [this](const HealthEvent& event) {
            if (!health_events_.push(event))
              unfetched_.fetch_add(1, std::memory_order_relaxed);
          }),
      processor_(config, options_.start, options_.calibration), flat_ground_(config.odometry.flat_ground),
      ingest_thread_([this] { run_ingest(); }), odometry_thread_([this] { run_odometry(); }) {
  pthread_setname_np(ingest_thread_.native_handle(), "ingest");
  pthread_setname_np(odometry_thread_.native_handle(), "odometry");
}

void LivePipeline::stop() {
  stopping_.store(true, std::memory_order_relaxed);
  if (ingest_thread_.joinable())
    ingest_thread_.join();
  if (odometry_thread_.joinable())
    odometry_thread_.join();
}

void LivePipeline::run_ingest() {
  options_.on_thread_start();
  bool more = true;
  while (more && !stopping_.load(std::memory_order_relaxed)) {
    ingest_progress_.fetch_add(1, std::memory_order_relaxed);
    const Input input = input_.next(kMaxSilence);
    ingest_.process(input);
    publish_fast_sample(input);
    publish_report();
    more = !std::holds_alternative<EndOfInput>(input);
  }
  ingest_ended_.store(true, std::memory_order_release);
  sweep_ready_.notify();
}

void LivePipeline::publish_fast_sample(const Input& input) {
  while (const std::optional<FastSample> estimate = estimates_to_propagate_.pop())
    fast_odometry_.set_estimate(*estimate);
  std::optional<FastSample> sample;
  if (const auto* imu = std::get_if<ImuInput>(&input))
    sample = fast_odometry_.predict(ingest_.sources(), imu->source, imu->sample.arrival);
  else if (const auto* odometry = std::get_if<OdometryInput>(&input))
    sample = fast_odometry_.predict(ingest_.sources(), odometry->source, odometry->sample.arrival);
  if (!sample)
    return;
  static_cast<void>(fast_samples_.push(*sample)); // dropped if not fetched
  estimate_ready_.notify();
}

void LivePipeline::publish_report() {
  const Duration now = read_clock(CLOCK_MONOTONIC_COARSE);
  if (now - reported_ < kMaxSleep)
    return;
  reported_ = now;
  input_.update_filter(ingest_.lidars());
  reports_.back().read(ingest_);
  static_cast<void>(reports_.publish());
}

/// Hands over a sweep and returns spare memory in exchange for its points.
void LivePipeline::hand_over(Sweep& sweep, const SweepCut& cut) {
  CutSweep& back = newest_sweep_.back();
  std::vector<SweepPoint> spare = std::exchange(back.sweep.points, {});
  spare.reserve(max_points_); // allocates for the first few sweeps only
  back = {std::move(sweep), cut};
  sweep.points = std::move(spare); // NOLINT(bugprone-use-after-move): the one member that was moved away
  seen_.fetch_add(1, std::memory_order_relaxed);
  while (const std::optional<RegistrationFeedback> feedback = feedback_.pop())
    ingest_.apply(*feedback);
  if (newest_sweep_.publish())
    dropped_.fetch_add(1, std::memory_order_relaxed);
  else
    sweep_ready_.notify();
}

void LivePipeline::run_odometry() {
  options_.on_thread_start();
  FlatGround flat_ground = flat_ground_.load(std::memory_order_relaxed);
  for (bool is_last = false; !is_last;) {
    odometry_progress_.fetch_add(1, std::memory_order_relaxed);
    if (const FlatGround wanted = flat_ground_.load(std::memory_order_relaxed); wanted != flat_ground)
      processor_.set_flat_ground(flat_ground = wanted);
    is_last = ingest_ended_.load(std::memory_order_acquire);
    if (const CutSweep* cut_sweep = newest_sweep_.poll())
      process(*cut_sweep);
    else if (!is_last)
      sweep_ready_.wait_for(kMaxSleep);
  }
  odometry_ended_.store(true, std::memory_order_release);
  estimate_ready_.notify();
}

void LivePipeline::process(const CutSweep& cut_sweep) {
  const Duration period = from_seconds(to_seconds(cut_sweep.sweep.end - cut_sweep.sweep.start) / options_.speed);
  const Duration deadline = cut_sweep.cut.start.wall + period;
  const ProcessedSweep done = processor_.process(cut_sweep.sweep, cut_sweep.cut, [this, deadline] {
    return stopping_.load(std::memory_order_relaxed) || read_clock(CLOCK_MONOTONIC) > deadline;
  });
  // Never full: one entry per sweep handed over, and the ingest empties the ring when it hands over the next.
  static_cast<void>(feedback_.push(processor_.odometry().feedback()));
  const OdometryEstimate& estimate = done.estimate;
  static_cast<void>(
      estimates_to_propagate_.push({estimate.stamp, estimate.T_odom_base, estimate.pose_covariance, estimate.twist_base,
                                    estimate.twist_covariance})); // never full: emptied with every input
  if (!estimates_.push(done))
    unfetched_.fetch_add(1, std::memory_order_relaxed);
  (estimate.failed ? failed_ : processed_).fetch_add(1, std::memory_order_release); // after everything was handed over
  estimate_ready_.notify();
  processor_.prepare_next();
  if (options_.after_estimate)
    options_.after_estimate(cut_sweep.sweep, processor_.odometry(), estimate);
}

std::optional<ProcessedSweep> LivePipeline::next(Duration timeout) {
  std::optional<ProcessedSweep> done = estimates_.pop();
  if (done)
    return done;
  estimate_ready_.wait_for(timeout);
  return estimates_.pop();
}

bool LivePipeline::finished() const { return odometry_ended_.load(std::memory_order_acquire) && estimates_.empty(); }

SweepCounters LivePipeline::counters() const {
  const auto read = [](const Counter& counter) { return counter.load(std::memory_order_acquire); };
  return {read(seen_), read(processed_), read(dropped_), read(failed_)};
}

} // namespace locus::daemon
