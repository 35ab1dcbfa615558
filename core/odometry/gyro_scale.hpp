// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace locus {

/// How far a gyro may be off in proportion to what it reads: not at all known until it has turned, for its sign or its
/// unit may be wrong. A prior that is sure of a wrong turn would bend what lidar sees of it. One owner.
class GyroScale {
 public:
  /// `read_rad` was read, and `excess_rad` more than the robot turned. Base axes.
  void learn(const Eigen::Vector3d& excess_rad, const Eigen::Vector3d& read_rad);

  /// Of a turn that is read. Base axes.
  [[nodiscard]] Eigen::Vector3d variance(const Eigen::Vector3d& read_rad) const;

 private:
  Eigen::Vector3d excess_squares_ = Eigen::Vector3d::Zero(), read_squares_ = Eigen::Vector3d::Zero();
};

} // namespace locus
