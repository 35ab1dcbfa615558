// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// Decides whether the map takes in a sweep (paper II-B.3), waits, or restarts. One owner.
class MapPolicy {
 public:
  enum class Verdict : std::uint8_t { wait, insert, restart };

  struct Outcome {
    Stamp stamp;
    Pose T_odom_base;
    bool accepted = false;              ///< accepted registration
    bool has_points = false;            ///< enough for a registration
    bool lacks_correspondences = false; ///< misses most of the usual correspondences; not inserted
    bool carried = false;               ///< an odometry source measures the translation
    bool turn_measured = false;         ///< a motion source measures the rotation
    double overlap = 1.0;               ///< share of the points that have a correspondence in the map
  };

  explicit MapPolicy(const MapOptions& options) : options_(options) {}

  /// Marks the map as one of another run in which the first sweep was found.
  void resume() { resumed_ = true; }
  /// Starts with the first sweep, or one that restarts the map.
  void begin(Stamp stamp, const Pose& T_odom_base);
  Verdict judge(const Outcome& outcome);

  /// Returns whether the registration of the last sweep with points was rejected.
  [[nodiscard]] bool is_refused() const { return refused_in_a_row_ > 0; }
  [[nodiscard]] bool was_accepted_lately(Stamp now) const;

 private:
  [[nodiscard]] bool is_keyframe_due(const Outcome& outcome) const;

  MapOptions options_;
  Pose T_odom_keyframe_;
  double best_overlap_ = 0.0; ///< since the last keyframe
  Stamp last_accepted_;
  int refused_in_a_row_ = 0;  ///< consecutive rejected sweeps with points
  std::int64_t accepted_ = 0; ///< accepted sweeps since the map was started
  bool resumed_ = false;
};

} // namespace locus
