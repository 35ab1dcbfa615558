// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// What becomes of the map with a sweep: whether it takes the sweep in (paper II-B.3), waits, or begins anew. One
/// owner.
class MapPolicy {
 public:
  enum class Verdict : std::uint8_t { waits, takes_in, begins_anew };

  struct Outcome {
    Stamp stamp;
    Pose T_odom_base;
    bool placed = false;        ///< by lidar
    bool has_points = false;    ///< enough to be placed
    bool misses_most = false;   ///< of the usual correspondences: not for the map
    bool carried = false;       ///< an odometry source tells the way
    bool turn_measured = false; ///< by a motion source
    double overlap = 1.0;       ///< share of the points that have a correspondence in the map
  };

  explicit MapPolicy(const MapOptions& options) : options_(options) {}

  /// The map holds what another run left behind, and the first sweep was found in it.
  void resume() { resumed_ = true; }
  /// The first sweep, or one that begins the map anew.
  void begin(Stamp stamp, const Pose& T_odom_base);
  Verdict judge(const Outcome& outcome);

  /// The last sweep with points was not placed.
  [[nodiscard]] bool is_refused() const { return refused_in_a_row_ > 0; }
  [[nodiscard]] bool was_placed_lately(Stamp now) const;

 private:
  [[nodiscard]] bool is_keyframe_due(const Outcome& outcome) const;

  MapOptions options_;
  Pose T_odom_keyframe_;
  double best_overlap_ = 0.0; ///< since the last keyframe
  Stamp last_placed_;
  int refused_in_a_row_ = 0; ///< sweeps with points
  std::int64_t placed_ = 0;  ///< sweeps, since the map was begun
  bool resumed_ = false;
};

} // namespace locus
