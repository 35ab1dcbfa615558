// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// Tells that the robot stands, and where: poses that come from noise alone are then held where they were, so that
/// standing adds no error however long it lasts. Odom frame. One owner.
class Standstill {
 public:
  /// The pose that lidar found, and whether any motion source saw motion since the one before. Gives the pose to be
  /// held, if the robot stands.
  std::optional<Pose> observe(Stamp stamp, const Pose& T_odom_base, bool sources_saw_motion);

  /// Lidar found nothing.
  void lose_sight() { begun_ = standing_ = false; }

 private:
  bool begun_ = false;
  bool standing_ = false;
  Stamp since_;
  Pose T_odom_held_;
};

} // namespace locus
