// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/odometry/motion_filter.hpp"
#include "core/odometry/odometry_estimate.hpp"

namespace locus::daemon {

/// Weighted linear least squares over a drive. Its covariance comes from the scatter of blocks of time about the common
/// solution (sandwich estimator, Liang and Zeger 1986), since errors of sensors are not white. A parameter that the
/// rows do not determine keeps its prior. Memory is bounded: pairs of blocks are merged when there are many. One owner.
template <int kParameters> class BlockedLeastSquares {
 public:
  using Row = Eigen::Matrix<double, kParameters, 1>;
  using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
  struct Solution {
    Row mean;
    Matrix covariance;
  };

  /// Takes the standard deviations of the priors, whose means are zero.
  explicit BlockedLeastSquares(const Row& prior_sigma);

  /// Adds the measurement `value` = row * parameters; `sigma` weights it relative to others.
  void add(Stamp stamp, const Row& row, double value, double sigma);
  [[nodiscard]] Solution solve() const;

 private:
  static constexpr std::size_t kMostBlocks = 64;
  struct Block {
    Matrix A = Matrix::Zero();
    Row b = Row::Zero();
  };

  Matrix prior_information_;
  std::vector<Block> blocks_;
  Duration block_length_ = std::chrono::seconds{2};
  std::optional<Stamp> block_start_;
};

/// Results of comparing an odometry with lidar. A value that the drive does not determine is the prior.
struct OdometryFindings {
  /// Standard deviations of the priors, whose means are zero.
  static constexpr double kPriorLate_s = 0.05, kPriorTurn_rad = 2.0 * kRadPerDeg, kPriorYawScale = 0.1;

  Learned late_s{0.0, kPriorLate_s}; ///< delay of its stamps after the motion that is left after late_ms was subtracted
  Learned yaw_scale{0.0, kPriorYawScale}; ///< excess of the yaw that it reports
  /// Rotation about each axis of the base that corrects T_base_lidar of all lidars: the true one is
  /// so3_exp(turn) * R_base_lidar.
  std::array<Learned, 3> lidar_turn_rad{Learned{0.0, kPriorTurn_rad}, Learned{0.0, kPriorTurn_rad},
                                        Learned{0.0, kPriorTurn_rad}};
};

/// Compares the motion of the base as an odometry and as lidar measure it, over a drive.
///
/// Lateness: a late yaw rate differs by its change. (Speed is no evidence: wheels drag when a robot brakes, as if they
/// were early.) Rotation of the lidars: the base moves as the odometry says, ahead and about its own vertical on
/// wheels; a tilted lidar observes it climbing, and turning about another axis. An offset of the point that the
/// odometry reports is estimated, too. Rotation and yaw scale are compared over a second, in which a gait cancels: its
/// sway about one axis correlates with that about another. Nothing is fed back to the estimate. One owner.
class OdometryComparison {
 public:
  OdometryComparison();

  /// Adds a sweep in which lidar observed all axes. `T_source_base`: pose of the base at its end, from the odometry;
  /// `lidar_twist_base`: mean twist since the end of the last sweep (m/s, rad/s).
  void add(Stamp end, const Pose& T_source_base, const Vector6& lidar_twist_base);
  /// Marks a sweep that cannot be compared.
  void interrupt();

  [[nodiscard]] OdometryFindings findings() const;

 private:
  struct Step {
    Stamp end;
    Pose T_source_base;
    Vector6 sensed = Vector6::Zero(), lidar = Vector6::Zero(); ///< mean twists since the last step
  };
  void compare_times(const Step& last, const Step& step, const Step& next);
  void accumulate(const Step& step, Duration elapsed);
  void compare_motion();

  BlockedLeastSquares<3> lateness_; ///< lateness (s), excess of yaw scale, yaw drift (rad/s)
  BlockedLeastSquares<2> yaw_;      ///< excess of yaw scale, yaw drift (rad/s)
  BlockedLeastSquares<4> turn_;     ///< rotation of the lidars (rad), offset of the reported point ahead (m)
  std::array<Step, 3> recent_;      ///< oldest first
  std::size_t steps_ = 0;           ///< number since the last interruption
  Step window_;                     ///< sums of motion (m, rad) over about a second
  Duration window_length_{};
};

/// Compares a sweep with the odometry that is this motion source, if it is one. `comparison` is created with its first
/// pose.
void compare(const OdometryEstimate& estimate, std::size_t source, std::optional<OdometryComparison>& comparison);

} // namespace locus::daemon
