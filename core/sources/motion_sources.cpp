// SPDX-License-Identifier: Apache-2.0
#include "core/sources/motion_sources.hpp"

#include <algorithm>
#include <utility>

namespace locus {

namespace {

bool is_usable(const HealthMonitor& health) { return health.healthy() && !health.is_too_slow(); }

} // namespace

MotionSources::MotionSources(const std::vector<MotionSourceOptions>& options, Fusion fusion, const MotionLimits& limits,
                             HealthSink health_sink)
    : fusion_(fusion), health_sink_(std::move(health_sink)) {
  sources_.reserve(options.size());
  for (const MotionSourceOptions& source : options)
    sources_.emplace_back(source, limits);
}

template <class Sample> void MotionSources::accept(SourceId source, Sample sample) {
  Source& from = sources_[index_of(source)];
  set_time(sample.arrival);
  const std::optional<Stamp> stamp = from.health.judge(sample);
  follow_health(source);
  if (!stamp)
    return;
  sample.stamp = *stamp;
  from.track.add(sample);
}
template void MotionSources::accept(SourceId, ImuSample);
template void MotionSources::accept(SourceId, OdometrySample);

void MotionSources::advance(Stamp now) {
  set_time(now);
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    sources_[i].health.advance(now_);
    follow_health(SourceId{i});
  }
}

/// Updates the time. Inputs may be slightly out of order; a larger step back means that the clock was set.
void MotionSources::set_time(Stamp now) {
  if (now > now_ || now < now_ - HealthMonitor::kLongestTimeout)
    now_ = now;
}

void MotionSources::on_feedback(const RegistrationFeedback& feedback) {
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    sources_[i].track.set_late(feedback.late[i]);
    RegistrationFeedback in_its_stamps = feedback;
    in_its_stamps.from += feedback.late[i];
    in_its_stamps.to += feedback.late[i];
    sources_[i].health.on_feedback(feedback.opinions[i], in_its_stamps, now_);
    follow_health(SourceId{i});
  }
}

void MotionSources::set_outside_verdict(SourceId source, bool healthy) {
  sources_[index_of(source)].health.set_outside_verdict(healthy, now_);
  follow_health(source);
}

void MotionSources::follow_health(SourceId source) {
  Source& of = sources_[index_of(source)];
  if (of.health.epoch() != of.epoch) {
    of.epoch = of.health.epoch();
    of.track.clear();
  }
  if (std::optional<HealthEvent> event = of.health.pop_event(); event && health_sink_) {
    event->source = source;
    health_sink_(*event);
  }
}

SourceChoice MotionSources::choose(Stamp now) const {
  const auto track_of = [this](SourceId source) -> const MotionTrack& { return sources_[index_of(source)].track; };
  return choose_sources([&](SourceId source) { return track_of(source).kind(); }, sources_.size(), fusion_,
                        [&](SourceId source) { return is_usable(health(source)) && track_of(source).is_live(now); });
}

std::optional<Pose> MotionSources::motion(const SourceChoice& choice, Stamp from, Stamp to) const {
  const auto step = [&](SourceId source) -> std::optional<Pose> {
    const std::optional<Pose> T_source_from = sources_[index_of(source)].track.at(from);
    const std::optional<Pose> T_source_to = sources_[index_of(source)].track.at(to);
    if (!T_source_from || !T_source_to)
      return std::nullopt;
    return T_source_from->inverse() * *T_source_to;
  };
  if (!choice.rotation)
    return Pose{};
  std::optional<Pose> T_from_to = step(*choice.rotation);
  if (!T_from_to || !choice.translation || choice.translation == choice.rotation)
    return T_from_to;
  const std::optional<Pose> moved = step(*choice.translation);
  if (!moved)
    return std::nullopt;
  T_from_to->translation = moved->translation;
  return T_from_to;
}

SensedMotion MotionSources::sensed_in(Stamp from, Stamp to) const {
  SensedMotion motion;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const auto& [health, track, epoch] = sources_[i];
    const std::optional<Pose> T_source_base = track.has_sample_in(from, to) ? track.at(to) : std::nullopt;
    if (!T_source_base)
      continue;
    const Stamp before = std::max(from, to - SourcePose::kMoment);
    const Pose T_before_to = track.at(before).value_or(*T_source_base).inverse() * *T_source_base;
    motion.sources[i] = {
        true, is_usable(health), epoch, *T_source_base, se3_log(T_before_to) / to_seconds(to - before), track.late()};
    if (is_usable(health) && health.trusts_accelerometer() && !motion.specific_force) {
      motion.specific_force = track.specific_force(from, to);
      if (motion.specific_force)
        motion.specific_force->source = SourceId{i};
    }
    if (health.healthy() && !motion.up_base)
      motion.up_base = track.up_base(from, to);
  }
  return motion;
}

} // namespace locus
