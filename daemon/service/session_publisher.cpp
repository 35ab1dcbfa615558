// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "daemon/service/session.hpp"

namespace locus::daemon {

namespace {

OdometryReport report_of(const FastSample& s) {
  return {s.stamp, s.T_odom_base, s.pose_covariance, s.twist_base, s.twist_covariance};
}

/// Describes the loss of a motion source. In a disagreement either the source or lidar may be at fault.
std::string loss_text(const HealthEvent& event) {
  if (!event.verdict.empty())
    return std::string(event.verdict);
  if (event.reason == HealthReason::disagreement || event.reason == HealthReason::speed)
    return std::string(explanation(event.reason));
  return fmt::format("is lost ({}): it {}", to_string(event.reason), explanation(event.reason));
}

} // namespace

void Session::run_publisher() {
  while (!stopping_.load(std::memory_order_relaxed)) {
    publisher_progress_.fetch_add(1, std::memory_order_relaxed);
    log_clock_steps();
    if (const auto done = pipeline_->next(std::chrono::milliseconds{50}))
      publish(*done);
    while (auto sample = pipeline_->next_fast()) {
      sample->stamp = input_.time().to_wall(sample->stamp);
      link_.publish_fast(report_of(*sample));
    }
    while (const auto event = pipeline_->next_health_event())
      log_health(*event);
    if (const IngestReport* report = pipeline_->next_report()) {
      const std::scoped_lock lock(collected_mutex_);
      collected_.ingest = *report;
    }
  }
}

void Session::log_clock_steps() {
  const Duration steps = input_.time().steps();
  if (const Duration change = steps - std::exchange(logged_clock_steps_, steps); change != Duration::zero())
    log_.info(fmt::format(
        "the clock of this computer stepped by {:+.3f} s; the odometry continues, and its stamps follow the clock",
        to_seconds(change)));
}

void Session::publish(const ProcessedSweep& done) {
  const OdometryEstimate estimate = in_wall_time(done.estimate);
  const bool is_published = link_.publish(report_of(estimate), estimate.state);
  {
    const std::scoped_lock lock(collected_mutex_);
    collected_.sweeps.add(done);
    collected_.unpublished += is_published ? 0 : 1;
  }
  if (estimate.beginning && !announced_)
    announce(estimate);
  if (announcement_ && link_.publish_beginning(DiagnosticsMessage({*announcement_}, estimate.stamp),
                                               resets_.load(std::memory_order_relaxed)))
    announcement_.reset();
  log_state(estimate.state);
}

/// Publishes and logs the origin of the odom frame, so that subscribers learn of a new frame.
void Session::announce(const OdometryEstimate& estimate) {
  announced_ = true;
  const Beginning from = *estimate.beginning;
  const bool is_lost = has_saved_map_ && from != Beginning::map;
  if (from == Beginning::origin || from == Beginning::told)
    resets_.fetch_add(1, std::memory_order_relaxed);
  const std::string text =
      from == Beginning::map    ? "resumed from the saved state"
      : from == Beginning::told ? "started at the requested pose"
      : from == Beginning::odometry
          ? "resumed at the pose of an odometry source; the first sweep does not match the saved state"
      : is_lost ? "started at the origin: the first sweep does not match the saved state"
                : "started at the origin";
  if (is_lost)
    log_.warn(text);
  else if (has_saved_map_)
    log_.info(text);
  const Eigen::Vector3d& p = estimate.T_odom_base.translation;
  announcement_ = {is_lost ? Diagnostic::Level::warning : Diagnostic::Level::ok,
                   "locusd: beginning",
                   text,
                   {{"from", std::string{to_string(from)}},
                    {"frame", config_.dds.frame_odom},
                    {"t_ns", fmt::format("{}", to_ns(estimate.stamp))},
                    {"x_m", fmt::format("{}", p.x())},
                    {"y_m", fmt::format("{}", p.y())},
                    {"z_m", fmt::format("{}", p.z())},
                    {"yaw_deg", fmt::format("{}", to_rpy_rad(estimate.T_odom_base.rotation).z() / kRadPerDeg)}}};
}

void Session::log_state(TrackingState state) {
  if (logged_state_ == state)
    return;
  logged_state_ = state;
  const std::string name{to_string(state)};
  if (state == TrackingState::dead_reckoning)
    log_.warn("dead reckoning: no sweep can be registered; check that the lidars send (locusctl status)",
              {{"LOCUS_STATE", name}});
  else if (state == TrackingState::degenerate)
    log_.warn("degenerate: the surroundings do not constrain every axis; motion sources determine the rest",
              {{"LOCUS_STATE", name}});
  else
    log_.info(name, {{"LOCUS_STATE", name}});
}

void Session::log_health(const HealthEvent& event) {
  const std::string& name = config_.motion_sources[index_of(event.source)].name;
  if (event.healthy)
    log_.info(fmt::format("motion source {} is used again", name), {{"LOCUS_SOURCE", name}});
  else
    log_.warn(fmt::format("motion source {} {}; the next best one is used", name, loss_text(event)),
              {{"LOCUS_SOURCE", name}, {"LOCUS_REASON", std::string{to_string(event.reason)}}});
}

} // namespace locus::daemon
