// SPDX-License-Identifier: Apache-2.0
#include "core/sources/motion_sources.hpp"

#include <utility>

namespace locus {

MotionSources::MotionSources(const std::vector<MotionSourceOptions>& options, Fusion fusion, HealthSink health_sink)
    : fusion_(fusion), health_sink_(std::move(health_sink)), sources_(options.begin(), options.end()) {}

template <class Sample> void MotionSources::take(std::size_t source, Sample sample) {
  Source& from = sources_[source];
  tell_time(sample.arrival);
  const std::optional<Stamp> stamp = from.health.judge(sample);
  follow_health(source);
  if (!stamp)
    return;
  sample.stamp = *stamp;
  from.track.add(sample);
}
template void MotionSources::take(std::size_t, ImuSample);
template void MotionSources::take(std::size_t, OdometrySample);

void MotionSources::advance(Stamp now) {
  tell_time(now);
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    sources_[i].health.advance(now_);
    follow_health(i);
  }
}

/// Inputs may come a little out of order. What lies further back is told by a clock that was set.
void MotionSources::tell_time(Stamp now) {
  if (now > now_ || now < now_ - HealthMonitor::kLongestTimeout)
    now_ = now;
}

void MotionSources::hear(const RegistrationFeedback& feedback) {
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    sources_[i].health.hear(feedback.opinions[i], feedback, now_);
    follow_health(i);
  }
}

void MotionSources::set_outside_verdict(std::size_t source, bool healthy) {
  sources_[source].health.set_outside_verdict(healthy, now_);
  follow_health(source);
}

void MotionSources::follow_health(std::size_t source) {
  Source& of = sources_[source];
  if (of.health.epoch() != of.epoch) {
    of.epoch = of.health.epoch();
    of.track.clear();
  }
  if (std::optional<HealthEvent> event = of.health.take_event(); event && health_sink_) {
    event->source = source;
    health_sink_(*event);
  }
}

SourceChoice MotionSources::choose(Stamp now) const {
  return choose_sources([this](std::size_t i) { return sources_[i].track.kind(); }, sources_.size(), fusion_,
                        [&](std::size_t i) { return healthy(i) && sources_[i].track.is_live(now); });
}

std::optional<Pose> MotionSources::motion(const SourceChoice& choice, Stamp from, Stamp to) const {
  const auto step = [&](std::size_t source) -> std::optional<Pose> {
    const std::optional<Pose> T_source_from = sources_[source].track.at(from);
    const std::optional<Pose> T_source_to = sources_[source].track.at(to);
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
    const MotionTrack& track = sources_[i].track;
    const std::optional<Pose> T_source_base = track.has_sample_in(from, to) ? track.at(to) : std::nullopt;
    if (!T_source_base)
      continue;
    motion.sources[i] = {true, healthy(i), sources_[i].epoch, *T_source_base};
    if (healthy(i) && sources_[i].health.trusts_accelerometer() && !motion.specific_force_base_mps2)
      motion.specific_force_base_mps2 = track.mean_specific_force_mps2(from, to);
    if (healthy(i) && !motion.up_base)
      motion.up_base = track.up_base(from, to);
  }
  return motion;
}

} // namespace locus
