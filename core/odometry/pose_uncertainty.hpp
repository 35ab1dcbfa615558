// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/pose.hpp"

namespace locus {

/// How far the pose may be off, since the start and against the submap.
///
/// A Kalman filter of the error alone: a prediction adds its own error to that of the pose before, what lidar sees
/// takes it away along the axes that lidar sees, and along the others it adds up, sweep by sweep. The part of an error
/// that is the same from sweep to sweep, as those of a wheel's radius or of a gyro's bias, adds up faster than noise
/// and is carried beside it. Of the error of a sweep that the map takes, a share stays in the map. All in odom
/// axes, as (translation, turn) about the robot. One owner.
class PoseUncertainty {
 public:
  /// The robot is said to have moved by `moved_m`, with a noise and with a part that comes again each time.
  void predict(const Eigen::Vector3d& moved_m, const Matrix6& noise, const Vector6& bias);

  /// Lidar has placed the robot in the submap.
  void see(const Matrix6& lidar_information);

  /// The map has taken the sweep as it was placed. Sweeps to come are laid against it and against all before it: where
  /// it showed much that was new its error comes back with them, where it only went over what was there it is one of
  /// many. `share` of it, along each axis, is now the map's.
  void keep(const Matrix6& share);

  [[nodiscard]] Matrix6 against_submap() const;
  [[nodiscard]] Matrix6 since_start() const;

 private:
  struct Error {
    Matrix6 noise = Matrix6::Zero(); ///< covariance
    Vector6 bias = Vector6::Zero();  ///< magnitudes

    /// Turns about where the robot was are shifts of where it is.
    void carry(const Eigen::Vector3d& moved_m);
    [[nodiscard]] Matrix6 covariance() const;
  };
  Error of_map_;   ///< of the submap, since the start
  Error of_sweep_; ///< against the submap
};

} // namespace locus
