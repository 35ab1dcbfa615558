// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// The flat ground assumption (paper II-C): no motion up or down, no roll, no pitch, in the gravity-aligned odometry
/// frame.
///
/// Known from context (on), or found (automatic): the inertial sensor has seen the base level for long enough. It ends
/// at once when the base is level no more. What is known is taken at its word. What was found only to the accuracy of
/// that sensor gives way to lidar along the axes that it sees better. One owner.
class FlatGroundAssumption {
 public:
  explicit FlatGroundAssumption(FlatGround mode) : mode_(mode) {}

  /// Looks at which way is up during a sweep, where that is known.
  void observe(Stamp stamp, const std::optional<Eigen::Vector3d>& up_base);

  [[nodiscard]] bool holds() const { return mode_ == FlatGround::on || (mode_ == FlatGround::automatic && found_); }

  /// T_odom_base, known with `information` (odom axes), as it is on the plane of T_odom_last. Precondition: holds().
  [[nodiscard]] Pose flatten(const Pose& T_odom_last, const Pose& T_odom_base, const Matrix6& information) const;

 private:
  FlatGround mode_;
  bool found_ = false;
  std::optional<Stamp> level_since_;
};

} // namespace locus
