// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/motion_track.hpp"
#include "core/options.hpp"
#include "core/sweep.hpp"

namespace locus {

/// Which sources stand for the motion of the base; nothing where none is healthy.
struct SourceChoice {
  std::optional<std::size_t> rotation;
  std::optional<std::size_t> translation;

  [[nodiscard]] Uncorrected uncorrected() const {
    if (translation)
      return Uncorrected::nothing;
    return rotation ? Uncorrected::translation : Uncorrected::all;
  }
};

/// All motion sources of the robot in a static priority queue (paper II-B.1, health monitoring and priority queue).
///
/// With Fusion::combined the best inertial source gives the rotation and the best odometry the translation; with
/// Fusion::queue the first healthy one in the queue gives all it has. One owner.
class MotionSources {
 public:
  MotionSources(const std::vector<MotionSourceOptions>& options, Fusion fusion);

  /// `source` is the index in the configuration; its kind must fit the sample.
  void add(std::size_t source, const ImuSample& sample) { tracks_[source].add(sample); }
  void add(std::size_t source, const OdometrySample& sample) { tracks_[source].add(sample); }

  /// Those whose tracks reach `now` and go on doing so: with two samples in the time for which tracks are extrapolated.
  /// A slower or silent source would correct a sweep with a standstill; that is left to Odometry.
  [[nodiscard]] SourceChoice choose(Stamp now) const;

  /// T_from_to of the base after the chosen sources; nothing where a track does not reach one of the instants.
  [[nodiscard]] std::optional<Pose> motion(const SourceChoice& choice, Stamp from, Stamp to) const;

  /// Writes the poses of all sources at the end of the sweep, and its specific force.
  void describe(Sweep& sweep) const;

  [[nodiscard]] const MotionTrack& track(std::size_t source) const { return tracks_[source]; }
  [[nodiscard]] std::size_t size() const { return tracks_.size(); }

 private:
  Fusion fusion_;
  std::vector<MotionTrack> tracks_;
};

/// Picks from sources in priority order those that `usable(index)` allows.
template <class Kinds, class Usable>
SourceChoice choose_sources(const Kinds& kind_of, std::size_t count, Fusion fusion, const Usable& usable) {
  SourceChoice choice;
  for (std::size_t i = 0; i < count; ++i) {
    if (!usable(i))
      continue;
    if (fusion == Fusion::queue) {
      choice.rotation = i;
      if (kind_of(i) == SourceKind::odometry)
        choice.translation = i;
      return choice;
    }
    std::optional<std::size_t>& place = kind_of(i) == SourceKind::imu ? choice.rotation : choice.translation;
    if (!place)
      place = i;
  }
  if (!choice.rotation)
    choice.rotation = choice.translation;
  return choice;
}

} // namespace locus
