// SPDX-License-Identifier: Apache-2.0
#include "restarting_pipeline.hpp"

#include <numeric>
#include <thread>
#include <utility>

#include "daemon/machine_time.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/print_message.hpp"
#include "support/patience.hpp"

namespace locus::soak {

namespace {

/// Slow motion, so that no registration reaches its deadline, however busy the machine.
constexpr double kNoHurry = 1e-3;

/// Ignores a state of an interrupted lap that is driven again: it would be of the future.
std::optional<daemon::SavedState> read_state(const std::filesystem::path& file, Stamp now) {
  if (!std::filesystem::exists(file))
    return std::nullopt;
  daemon::SavedState state = tools::value_or_fail(daemon::load_state(file), tools::ExitStatus::failed);
  return state.last.stamp <= now ? std::optional(std::move(state)) : std::nullopt;
}

} // namespace

RestartingPipeline::RestartingPipeline(Config config, daemon::InputSource& input, std::filesystem::path state_file,
                                       Take take)
    : config_(std::move(config)), input_(input), state_file_(std::move(state_file)), take_(std::move(take)) {}

RestartingPipeline::~RestartingPipeline() = default;

void RestartingPipeline::begin(Stamp now) {
  daemon::LiveOptions options;
  options.speed = kNoHurry;
  if (auto state = read_state(state_file_, now)) {
    options.calibration = {state->last.learned, to_seconds(now - state->last.stamp)};
    options.start = {state->last, std::move(state->map_odom)};
  }
  options.after_estimate = [this](const Sweep&, const Odometry& odometry, const OdometryEstimate& estimate) {
    resumed_.store(estimate.beginning == Beginning::map, std::memory_order_relaxed);
    state_saver_->update(odometry, estimate, FlatGround::off);
  };
  resumed_.store(false, std::memory_order_relaxed);
  state_saver_.emplace(state_file_, config_.motion_sources,
                       [](const std::string& problem) { tools::print_message("soak", problem); });
  disk_.emplace("disk", std::chrono::milliseconds{10}, [this](bool /*last*/) { state_saver_->write(); });
  pipeline_.emplace(config_, tools::value_or_fail(LidarRouter::open(config_.lidars), tools::ExitStatus::failed), input_,
                    std::move(options));
  input_.wait_for(&*pipeline_);
}

void RestartingPipeline::end(End how) {
  pipeline_->stop();
  input_.wait_for(nullptr);
  while (!pipeline_->finished())
    fetch(Duration::zero());
  daemon::IngestReport report;
  report.read(pipeline_->ingest());
  before_ = with(report);
  const std::optional<ResumeState> last = state_saver_->last();
  if (how == End::crash && last)
    wait_for_disk(*last);
  disk_.reset();
  state_saver_.reset();
  if (how == End::orderly && last) {
    daemon::SavedState state{*last, FlatGround::off, {}};
    daemon::read_map(pipeline_->processor().odometry(), state.last.T_odom_base, state.map_odom);
    if (const auto problem = daemon::write_state(state_file_, state))
      throw tools::Failure(tools::ExitStatus::failed, *problem);
  }
  pipeline_.reset();
}

/// Waits until the state is written. An accelerated drive outruns a busy disk by seconds of stamps; a real robot does
/// not.
void RestartingPipeline::wait_for_disk(const ResumeState& last) const {
  const Duration give_up = daemon::read_clock(CLOCK_MONOTONIC) + test::patience();
  while (daemon::read_clock(CLOCK_MONOTONIC) < give_up) {
    const auto written = daemon::load_state(state_file_);
    if (written && written->last.stamp == last.stamp)
      return;
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
}

void RestartingPipeline::fetch(Duration timeout) {
  for (auto done = pipeline_->next(timeout); done; done = pipeline_->next(Duration::zero())) {
    ++fetched_;
    take_(*done);
  }
  while (pipeline_->next_fast()) {
  }
  while (pipeline_->next_health_event()) {
  }
}

bool RestartingPipeline::is_idle() const {
  const daemon::SweepCounters now = pipeline_->counters();
  const std::uint64_t estimates = before_.processed + before_.failed + now.processed + now.failed;
  return now.seen == now.processed + now.failed + now.dropped && fetched_ + pipeline_->unfetched() >= estimates;
}

Counts RestartingPipeline::with(const daemon::IngestReport& report) const {
  const daemon::SweepCounters sweeps = pipeline_->counters();
  Counts counts = before_;
  counts.datagrams_received += report.total.received;
  counts.data += report.total.data;
  counts.position += report.total.position;
  counts.rejected = std::accumulate(report.total.rejected.begin(), report.total.rejected.end(), counts.rejected);
  for (const daemon::IngestReport::Source& source : report.sources)
    counts.samples_received += source.counters.received;
  counts.seen += sweeps.seen;
  counts.processed += sweeps.processed;
  counts.failed += sweeps.failed;
  counts.dropped += sweeps.dropped;
  counts.unfetched += pipeline_->unfetched();
  counts.fetched = fetched_;
  return counts;
}

Counts RestartingPipeline::counts() {
  constexpr Duration kPatience = std::chrono::seconds{2};
  const Duration give_up = daemon::read_clock(CLOCK_MONOTONIC) + kPatience;
  static_cast<void>(pipeline_->next_report()); // may be older than the rest
  const daemon::IngestReport* report = nullptr;
  while (report == nullptr && daemon::read_clock(CLOCK_MONOTONIC) < give_up) {
    fetch(std::chrono::milliseconds{10});
    report = pipeline_->next_report();
  }
  return report != nullptr ? with(*report) : before_;
}

} // namespace locus::soak
