// SPDX-License-Identifier: Apache-2.0
#include "simulated_time/frame_judge.hpp"

#include <algorithm>
#include <ctime>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/machine_time.hpp"

namespace locus::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using enum DayFault;

constexpr Duration kMoment = seconds{2};    ///< until an announcement is received
constexpr Duration kBaseline = seconds{10}; ///< over which the motion is compared
constexpr Duration kLongest = seconds{120}; ///< longest such interval, after a gap in the estimates
constexpr double kHealthy_m = 0.2;          ///< motion error over 10 s while the sensors work
constexpr double kAfterStop_m = 0.5;        ///< after a stop of the service in between
constexpr double kWithoutLidar_m = 1.5;     ///< after motion measured by wheels and IMU only

} // namespace

void FrameJudge::look(Listener& listener, const ClockFile& clock) {
  for (const Listener::Beginning& beginning : listener.new_beginnings()) {
    if (beginning.stamp == last_beginning_) // received again after rediscovery of the service
      continue;
    last_beginning_ = beginning.stamp;
    ++beginnings_;
    if (beginning.from == "origin" || beginning.from == "told") {
      announced_ = events_.now();
      ++anew_;
    }
  }
  const std::vector<Listener::Estimate> estimates = listener.new_estimates();
  const Duration set_by = clock.set_by();
  const Stamp steady{daemon::read_clock(CLOCK_REALTIME) - set_by};
  for (const Listener::Estimate& estimate : estimates)
    take(estimate, set_by, steady);
  for (; !waiting_.empty() && events_.now() - waiting_.front().at > kMoment; waiting_.pop_front())
    judge(waiting_.front());
  look_whether_heard();
}

/// Expects an estimate within a fault-dependent time after each fault.
void FrameJudge::look_whether_heard() {
  constexpr Duration kAlways = seconds{3}; ///< tolerated gap
  const bool is_excused = events_.any({link_down}, seconds{25}) ||
                          events_.any({process_stop, thread_hang, crash}, seconds{15}) ||
                          events_.now() - life_began_ < seconds{15} || events_.any({lidar_lost, reload}, seconds{6});
  if (events_.now() - heard_at_ < kAlways || is_excused) {
    told_silence_ = false;
    return;
  }
  if (!std::exchange(told_silence_, true))
    events_.find(fmt::format("no odometry for {:.1f} s", to_seconds(events_.now() - heard_at_)));
}

void FrameJudge::take(const Listener::Estimate& estimate, Duration set_by, Stamp steady) {
  constexpr Duration kLatest = seconds{1};
  ++heard_;
  heard_at_ = events_.now();
  if (events_.any({clock_step}, seconds{4})) // unknown by which clock it was stamped
    return;
  const Stamp stamp = estimate.stamp - set_by;
  const bool may_be_late = events_.any({process_stop, thread_hang, link_down, deaf_reader}, seconds{15});
  if (stamp > steady + milliseconds{20} || (stamp < steady - kLatest && !may_be_late))
    events_.find(fmt::format("an estimate is stamped {:+.3f} s from its reception", to_seconds(stamp - steady)));
  if (const auto truth = robot_.truth_at(stamp))
    waiting_.push_back({events_.now(), stamp, estimate.T_odom_base, *truth});
}

double FrameJudge::bound_m(const Seen& from) const {
  const Duration since = events_.now() - from.at + seconds{2};
  if (events_.any({lidar_lost}, since))
    return kWithoutLidar_m;
  return events_.any({process_stop, thread_hang, crash, reload, link_down}, since) ? kAfterStop_m : kHealthy_m;
}

void FrameJudge::judge(const Seen& seen) {
  const bool is_blind = events_.any({lidar_lost}, seconds{3}) &&
                        events_.any({odometry_lost, link_down, process_stop, thread_hang, crash}, seconds{30});
  const bool begins_anew = std::chrono::abs(announced_ - seen.at) < seconds{4};
  if (is_blind || begins_anew || events_.is_disturbed())
    before_.clear();
  while (!before_.empty() &&
         (seen.at - before_.front().at > kLongest || (before_.size() > 1 && seen.at - before_[1].at > kBaseline)))
    before_.pop_front();
  if (!before_.empty()) {
    const Seen& from = before_.front();
    const Pose told = from.T_odom_base.inverse() * seen.T_odom_base;
    const Pose truth = from.T_world_base.inverse() * seen.T_world_base;
    const double error_m = (told.translation - truth.translation).norm();
    const double bound = bound_m(from);
    if (bound == kHealthy_m)
      worst_healthy_m_ = std::max(worst_healthy_m_, error_m);
    if (error_m > bound) {
      events_.find(fmt::format("{:.2f} m off after {:.1f} s, more than {:.1f} m", error_m,
                               to_seconds(seen.at - from.at), bound));
      before_.clear();
    }
  }
  before_.push_back(seen);
}

} // namespace locus::test
