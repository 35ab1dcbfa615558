// SPDX-License-Identifier: Apache-2.0
#include "soak.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <fstream>
#include <iterator>
#include <numeric>

#include <fmt/format.h>
#include <malloc.h>

#include "accuracy/trajectory_accuracy.hpp"
#include "config/config_yaml.hpp"
#include "daemon/machine_time.hpp"
#include "faults/fault.hpp"
#include "locus_replay/failure.hpp"
#include "locus_replay/quantiles.hpp"

namespace locus::soak {

namespace {

using tools::ExitStatus;
using tools::Quantiles;
using tools::value_or_fail;

Config config_of(const ClosedCourse& course) {
  auto config = load_config(course.folder / "config.yaml");
  if (!config)
    throw tools::Failure(ExitStatus::failed, fmt::format("{}", fmt::join(config.error(), "\n")));
  config->odometry.threads = 1;
  return *std::move(config);
}

/// Fractions of the lap at which the robot drives and stands, respectively.
constexpr double kRestartDriving = 0.6, kRestartStanding = 0.92;

struct FaultOfLap {
  std::string_view what;
  double most_s; ///< longest duration; capped at a quarter of the lap
};

/// Faults of each lap in a cycle of six; all start after a quarter of the lap.
const std::array<std::vector<FaultOfLap>, 6> kFaults{
    {{},
     {{"wio:lost", 10}},
     {{"all-lidars:lost", 5}},
     {{"all-lidars:packet-loss=5", 60}, {"all-lidars:reorder=5", 60}, {"all-lidars:duplicate=5", 60}},
     {{"imu:nan", 5}, {"wio:jump=2", 10}},
     {{"all-lidars:clock-step=1800", 20}, {"wio:frozen", 5}}}};

std::vector<Fault> faults_of(std::uint64_t lap, Duration lap_duration, std::string& names) {
  const double quarter_s = to_seconds(lap_duration) / 4.0;
  std::vector<Fault> faults;
  for (const FaultOfLap& fault : kFaults.at(lap % kFaults.size())) {
    const std::string text =
        fmt::format("{}@{:.3f}-{:.3f}", fault.what, quarter_s, quarter_s + std::min(fault.most_s, quarter_s));
    faults.push_back(value_or_fail(Fault::parse(text), ExitStatus::failed));
    names += (names.empty() ? "" : ", ") + text;
  }
  if (faults.empty())
    names = "no fault";
  return faults;
}

/// Returns the anonymous memory of the process, without mapped files and memory cached by the allocator.
double rss_anon_mb() {
  malloc_trim(0);
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("RssAnon:"))
      return 1.024e-3 * std::stod(line.substr(8));
  return 0.0;
}

int open_descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<int>(std::distance(begin(all), end(all)));
}

} // namespace

Soak::Soak(const ClosedCourse& course, const std::filesystem::path& folder, std::uint64_t laps_done, std::uint64_t laps)
    : lap_duration_(course.lap), config_(config_of(course)),
      truth_(value_or_fail(read_trajectory(course.folder / "gt.tum"), ExitStatus::failed)), lap_(laps_done),
      laps_(laps), process_ns_(daemon::read_clock(CLOCK_REALTIME).count()), course_(course, config_, laps_done),
      pipeline_(config_, course_, folder / "state", [this](const daemon::ProcessedSweep& done) { take(done); }) {
  pipeline_.begin(course_.now());
}

void Soak::take(const daemon::ProcessedSweep& done) {
  estimates_.push_back({done.estimate.stamp - lap_begin_, done.estimate.T_odom_base});
  cpu_ms_.push_back(1e3 * to_seconds(done.took.cpu));
  latency_ms_.push_back(1e3 * to_seconds(done.took.wall));
}

/// Restarts with one second of downtime, as the service does.
void Soak::restart() {
  using End = RestartingPipeline::End;
  pipeline_.end(lap_ % 2 == 0 ? End::orderly : End::crash);
  course_.miss(std::chrono::seconds{1});
  pipeline_.begin(course_.now());
}

Duration Soak::time_of_restart() const {
  return from_seconds((lap_ / 2 % 2 == 0 ? kRestartDriving : kRestartStanding) * to_seconds(lap_duration_));
}

void Soak::drive_to_rest() {
  while (!course_.is_at_rest() || !pipeline_.is_idle())
    pipeline_.fetch(std::chrono::milliseconds{10});
}

Piece Soak::drive_lap() {
  Piece piece;
  const Duration cpu_before = daemon::read_clock(CLOCK_PROCESS_CPUTIME_ID);
  estimates_.clear();
  cpu_ms_.clear();
  latency_ms_.clear();
  lap_begin_ = course_.offset();
  const bool restarts = lap_ >= laps_ / 2;
  course_.begin_lap(faults_of(lap_, lap_duration_, piece.faults), restarts ? time_of_restart() : lap_duration_);
  drive_to_rest();
  if (restarts) {
    restart();
    ++piece.restarts;
    course_.go_on();
    drive_to_rest();
  }
  piece.resumed = piece.restarts > 0 && pipeline_.has_resumed() ? 1 : 0;
  piece.whole_cpu_ms = 1e3 * to_seconds(daemon::read_clock(CLOCK_PROCESS_CPUTIME_ID) - cpu_before) /
                       static_cast<double>(std::max<std::size_t>(estimates_.size(), 1));
  ++lap_;
  count_and_measure(piece);
  return piece;
}

void Soak::count_and_measure(Piece& piece) {
  piece.process_ns = process_ns_;
  piece.hour = to_seconds(course_.offset()) / 3600.0;
  piece.lap_s = to_seconds(lap_duration_);
  piece.counts = pipeline_.counts();
  piece.counts.datagrams_given = course_.given().datagrams;
  const auto& samples = course_.given().samples;
  piece.counts.samples_given = std::accumulate(samples.begin(), samples.end(), std::uint64_t{0});

  const Quantiles cpu(cpu_ms_), latency(latency_ms_);
  piece.cpu_p50_ms = cpu.at(0.5);
  piece.cpu_p99_ms = cpu.at(0.99);
  piece.latency_p50_ms = latency.at(0.5);
  piece.latency_p99_ms = latency.at(0.99);
  if (const auto accuracy = trajectory_accuracy(estimates_, truth_)) {
    piece.ape_mean_mm = 1e3 * accuracy->ape_m.mean;
    piece.ape_max_mm = 1e3 * accuracy->ape_m.max;
  }
  if (!estimates_.empty())
    piece.astray_mm = 1e3 * estimates_.back().T_source_base.translation.norm();
  piece.rss_anon_mb = rss_anon_mb();
  piece.descriptors = open_descriptors();
}

} // namespace locus::soak
