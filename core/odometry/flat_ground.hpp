// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// Flat ground assumption (paper II-C): no vertical motion, no roll and no pitch in the gravity-aligned odometry frame.
///
/// Known from context (on), or detected (automatic): the inertial sensor has measured a level base for long enough. It
/// ends as soon as the base is no longer level. The known assumption holds exactly. The detected one is only as
/// accurate as that sensor and yields to lidar along the axes that lidar observes better. One owner.
class FlatGroundAssumption {
 public:
  explicit FlatGroundAssumption(FlatGround mode) : mode_(mode) {}

  /// Processes the up direction measured in a sweep, if there is one.
  void observe(Stamp stamp, const std::optional<Eigen::Vector3d>& up_base);

  [[nodiscard]] bool holds() const { return mode_ == FlatGround::on || (mode_ == FlatGround::automatic && found_); }

  /// Projects T_odom_base, known with `information` (odom axes), onto the plane of T_odom_last. Precondition: holds().
  [[nodiscard]] Pose flatten(const Pose& T_odom_last, const Pose& T_odom_base, const Matrix6& information) const;

 private:
  FlatGround mode_;
  bool found_ = false;
  std::optional<Stamp> level_since_;
};

} // namespace locus
