// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/clock_follower.hpp"

#include <chrono>

namespace locus::tools {
namespace {

constexpr Duration kStepTolerance = std::chrono::milliseconds{500}; ///< of the instant of a step
constexpr Duration kLongestBack = std::chrono::milliseconds{100};   ///< of samples that are merely out of order
constexpr Duration kLongestGap = std::chrono::hours{24};            ///< in a recording
constexpr Duration kLongestAhead = std::chrono::seconds{10};        ///< of samples before the begin
constexpr Duration kUsualInterval = std::chrono::seconds{1};        ///< longest

} // namespace

ClockFollower::Resolved ClockFollower::resolve(Stamp time, const std::vector<ClockStep>& steps) const {
  if (!last_)
    return {time, next_step_};
  const auto is_explained_by = [this](Duration step, Duration interval) {
    return std::chrono::abs(interval - step - interval_) < std::chrono::abs(interval - interval_);
  };
  Duration interval = time - *last_;
  std::size_t next = next_step_;
  for (; next < steps.size(); ++next) {
    const Duration without = interval - steps[next].by;
    const bool is_past = last_steady_ > steps[next].at + kStepTolerance;
    const bool is_across = !is_past && last_steady_ + without >= steps[next].at - kStepTolerance;
    if (is_across && is_explained_by(steps[next].by, interval))
      interval = without;
    else if (!is_past)
      break;
  }
  if (own_step_by_ != Duration{} && is_explained_by(-own_step_by_, interval))
    return {last_steady_ + interval + own_step_by_, next, ClockStep{last_steady_, -own_step_by_}};
  const bool is_known = interval_ > Duration{} && last_steady_ + kLongestAhead >= begin_;
  if (!is_known || (interval >= -kLongestBack && interval <= kLongestGap))
    return {last_steady_ + interval, next};
  return {last_steady_ + interval_, next, ClockStep{last_steady_, interval - interval_}};
}

Stamp ClockFollower::pass(Stamp time, const std::vector<ClockStep>& steps) {
  const Resolved resolved = resolve(time, steps);
  const Duration interval = resolved.steady - last_steady_;
  if (last_ && !resolved.own_step && interval > Duration{} && interval <= kUsualInterval)
    interval_ = interval;
  if (resolved.own_step) {
    own_step_by_ = resolved.own_step->by == -own_step_by_ ? Duration{} : resolved.own_step->by;
    first_own_step_ = own_steps_++ == 0 ? *resolved.own_step : first_own_step_;
  }
  next_step_ = resolved.next_step;
  last_ = time;
  return last_steady_ = resolved.steady;
}

} // namespace locus::tools
