// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/sources/health_monitor.hpp"
#include "core/sources/motion_track.hpp"
#include "core/sources/sensed_motion.hpp"

namespace locus {

/// All motion sources of the robot in a static priority queue, each with its health (paper II-B.1, health monitoring
/// and priority queue).
///
/// With Fusion::combined the best inertial source provides the rotation and the best odometry the translation; with
/// Fusion::queue the first healthy source in the queue provides all that it measures. One owner.
class MotionSources {
 public:
  /// Receives each change of health once, in the calling thread.
  using HealthSink = std::function<void(const HealthEvent&)>;

  MotionSources(const std::vector<MotionSourceOptions>& options, Fusion fusion, const MotionLimits& limits = {},
                HealthSink health_sink = {});

  /// Add a sample; its type must fit the kind of the source.
  void add(SourceId source, const ImuSample& sample) { accept(source, sample); }
  void add(SourceId source, const OdometrySample& sample) { accept(source, sample); }

  /// Sets the time, in stamps of arrival, so that silence is detected.
  void advance(Stamp now);

  /// Passes lidar's feedback on to the sources.
  void on_feedback(const RegistrationFeedback& feedback);

  /// Sets the external verdict on a source, valid until the next one (health_topic).
  void set_outside_verdict(SourceId source, bool healthy);

  /// Chooses the healthy sources whose tracks reach `now` and will continue to: the interval between the latest two
  /// samples is within the limit of extrapolation. A slower or silent source would correct a sweep with zero motion;
  /// that is left to Odometry.
  [[nodiscard]] SourceChoice choose(Stamp now) const;

  /// Returns T_from_to of the base, measured by the chosen sources; nothing if a track does not cover both instants.
  [[nodiscard]] std::optional<Pose> motion(const SourceChoice& choice, Stamp from, Stamp to) const;

  /// Returns the latest instant for which the motion of a source is known without extrapolation; nothing if unknown.
  [[nodiscard]] std::optional<Stamp> newest(SourceId source) const { return sources_[index_of(source)].track.newest(); }

  /// Returns the measurements of all sources in (from, to]: poses at its end, and the specific force during it.
  [[nodiscard]] SensedMotion sensed_in(Stamp from, Stamp to) const;

  [[nodiscard]] const HealthMonitor& health(SourceId source) const { return sources_[index_of(source)].health; }
  [[nodiscard]] std::size_t size() const { return sources_.size(); }

 private:
  struct Source {
    Source(const MotionSourceOptions& options, const MotionLimits& limits) : health(options, limits), track(options) {}

    HealthMonitor health;
    MotionTrack track;
    std::uint32_t epoch = 0; ///< of the samples in the track
  };

  template <class Sample> void accept(SourceId source, Sample sample);
  void set_time(Stamp now);
  void follow_health(SourceId source);

  Fusion fusion_;
  HealthSink health_sink_;
  std::vector<Source> sources_;
  Stamp now_; ///< latest arrival
};

/// Chooses from `count` sources, in priority order, those that `usable(SourceId)` allows.
template <class Kinds, class Usable>
SourceChoice choose_sources(const Kinds& kind_of, std::size_t count, Fusion fusion, const Usable& usable) {
  SourceChoice choice;
  for (std::size_t i = 0; i < count; ++i) {
    const SourceId source{i};
    if (!usable(source))
      continue;
    if (fusion == Fusion::queue) {
      choice.rotation = source;
      if (kind_of(source) == SourceKind::odometry)
        choice.translation = source;
      return choice;
    }
    std::optional<SourceId>& place = kind_of(source) == SourceKind::imu ? choice.rotation : choice.translation;
    if (!place)
      place = source;
  }
  if (!choice.rotation)
    choice.rotation = choice.translation;
  return choice;
}

} // namespace locus
