// SPDX-License-Identifier: Apache-2.0
#include "daemon/machine_time.hpp"

#include <algorithm>
#include <cassert>
#include <ctime>

namespace locus::daemon {

namespace {

constexpr bool is_sampled(std::size_t stage) {
  return stage == static_cast<std::size_t>(Stage::decode) || stage == static_cast<std::size_t>(Stage::correct);
}

Duration cheapest_reading(StageStopwatch::Clock clock) {
  Duration cheapest = Duration::max();
  Duration last = clock(CLOCK_THREAD_CPUTIME_ID);
  for (int i = 0; i < 100; ++i) {
    const Duration now = clock(CLOCK_THREAD_CPUTIME_ID);
    cheapest = std::min(cheapest, now - last);
    last = now;
  }
  return cheapest;
}

} // namespace

StageStopwatch::StageStopwatch(Clock clock) : clock_(clock), reading_cost_(cheapest_reading(clock)) {}

void StageStopwatch::enter(std::size_t stage) {
  assert(depth_ < kMaxDepth);
  const bool timed = !is_sampled(stage) || visits_[stage] % kSampling == 0;
  ++visits_[stage];
  if (timed)
    charge_innermost();
  open_[depth_++] = {stage, timed};
}

void StageStopwatch::leave() {
  if (open_[depth_ - 1].timed)
    charge_innermost();
  --depth_;
}

/// Charges the innermost stage if its visit is timed; untimed visits are extrapolated from the timed ones.
void StageStopwatch::charge_innermost() {
  const Duration now = clock_(CLOCK_THREAD_CPUTIME_ID);
  if (depth_ > 0 && open_[depth_ - 1].timed)
    totals_[open_[depth_ - 1].stage] += now - mark_ - reading_cost_;
  mark_ = now;
}

Duration StageStopwatch::total(Stage stage) const {
  const auto index = static_cast<std::size_t>(stage);
  const Duration timed = std::max(Duration::zero(), totals_[index]);
  if (!is_sampled(index) || visits_[index] == 0)
    return timed;
  const std::uint64_t timed_visits = (visits_[index] + kSampling - 1) / kSampling;
  return from_seconds(to_seconds(timed) * static_cast<double>(visits_[index]) / static_cast<double>(timed_visits));
}

/// Clamps differences at zero, since an extrapolated total may decrease slightly.
StageTimes StageStopwatch::lap() {
  StageTimes spent;
  for (std::size_t stage = 0; stage < kStages; ++stage) {
    const Duration now = total(static_cast<Stage>(stage));
    spent[stage] = std::max(Duration::zero(), now - totals_at_lap_[stage]);
    totals_at_lap_[stage] = now;
  }
  return spent;
}

} // namespace locus::daemon
