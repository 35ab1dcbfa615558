// SPDX-License-Identifier: Apache-2.0
#include "daemon/service/state_saver.hpp"

#include <chrono>
#include <system_error>

#include <fmt/format.h>

namespace locus::daemon {

/// Tells whether a full state is due. A clock that was set back does not delay it.
bool StateSaver::is_due() const {
  return !saved_ || std::chrono::abs(last_->stamp - saved_->stamp) > kPeriod ||
         (last_->T_odom_base.translation - saved_->T_odom_base.translation).norm() > kDistance_m;
}

void StateSaver::reset(const std::optional<SavedState>& start) {
  last_.reset();
  saved_.reset();
  written_.reset();
  static_cast<void>(states_.poll()); // discards stale data
  static_cast<void>(resume_state_.poll());
  std::error_code error;
  if (file_ && start) {
    if (const auto problem = write_state(*file_, *start))
      error_sink_(*problem);
  } else if (file_ && !std::filesystem::remove(*file_, error) && error) {
    error_sink_(fmt::format("{}: cannot be removed ({}); a restart within a minute resumes from it", file_->string(),
                            error.message()));
  }
}

void StateSaver::update(const Odometry& odometry, const OdometryEstimate& estimate, FlatGround flat_ground) {
  if (!estimate.beginning) // the saved state is still valid
    return;
  last_ = last_.value_or(ResumeState{}).followed_by(estimate);
  if (!file_)
    return;
  if (!estimate.failed && is_due()) {
    saved_ = last_;
    PendingState& pending = states_.back();
    pending.number = ++number_;
    pending.state.last = *last_;
    pending.state.flat_ground = flat_ground;
    pending.state.sources = sources_;
    read_map(odometry, last_->T_odom_base, pending.state.map_odom);
    static_cast<void>(states_.publish()); // replaces an older unwritten state
  }
  resume_state_.back() = {number_, *last_};
  static_cast<void>(resume_state_.publish());
}

/// Reads the resume state first: the state that it refers to is then pending or already written.
void StateSaver::write() {
  const PendingUpdate* const update = resume_state_.poll();
  if (const PendingState* const pending = states_.poll()) {
    const auto problem = write_state(*file_, pending->state);
    written_ = problem ? std::nullopt : std::optional{pending->number};
    if (problem && !has_failed_)
      error_sink_(*problem);
    has_failed_ = problem.has_value();
  }
  if (update != nullptr && update->number == written_)
    update_resume_state(*file_, update->last);
}

} // namespace locus::daemon
