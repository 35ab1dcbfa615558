// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus {

/// Decides whether a gyro measures turns about the axes that its mounting says, or whether they are exchanged or
/// reversed. It compares the turns of gyro and lidar under all 48 assignments of three axes to three axes: a sequential
/// test (Wald 1945). Turns are summed until one exceeds noise, for a second at most: a gait turns a robot within a
/// sweep, a slope in a second.
///
/// Stamps that are late exchange axes, too: in a gait, roll and pitch lag each other. So the assignment must explain
/// the turns better than any delay of the gyro does, and better than turns that are unrelated, as those of a lidar that
/// has lost its way. Turns about one axis say nothing about the others.
///
/// A gyro in deg/s is found in the same way: a fifty-seventh of its turns must explain those of lidar better than the
/// turns as they are, than half or twice as much, and than none. So the robot has to turn: vibrations of one at rest
/// are enormous then, but those of a noisy gyro are, too. One owner.
class AxesCheck {
 public:
  /// Delays of the gyro's stamps that are considered: from -kMostLate to kMostLate.
  static constexpr Duration kMostLate = std::chrono::milliseconds{250}, kLateStep = std::chrono::milliseconds{25};
  static constexpr std::size_t kLates = 2 * (kMostLate / kLateStep) + 1;
  static constexpr Duration late(std::size_t i) { return static_cast<int>(i) * kLateStep - kMostLate; }

  /// Turns in a sweep as measured by the gyro, if its stamps are late by late(i): rotation vectors in the axes of the
  /// base as its mounting defines them.
  using GyroTurns = std::array<Eigen::Vector3d, kLates>;

  AxesCheck();

  /// Largest turn in a sweep that may be noise of lidar.
  static constexpr double kNoise_rad = 0.4 * kRadPerDeg;

  /// Returns the turn about one axis that is no evidence beside those about all: noise of lidar, and what a mounting
  /// error moves there from other axes.
  static double noise_rad(const Eigen::Vector3d& gyro_rad, const Eigen::Vector3d& lidar_rad);

  /// Adds a sweep in which lidar observed all rotations.
  void add(const Eigen::Vector3d& lidar_rad, const GyroTurns& gyro_rad, double elapsed_s);

  /// Tells whether the axes are certainly others than those of the mounting. Once true, it remains so.
  [[nodiscard]] bool is_wrong() const { return wrong_; }
  /// Returns the matrix that maps turns in the axes of the mounting to those of the base, once a single one explains
  /// them. Its determinant is -1 if no mounting does.
  [[nodiscard]] const std::optional<Eigen::Matrix3d>& axes() const { return axes_; }
  /// Tells whether the gyro certainly reports deg/s. Once true, it remains so.
  [[nodiscard]] bool is_in_degrees() const { return in_degrees_; }

 private:
  static constexpr std::size_t kAssignments = 48; ///< the first is the identity
  static constexpr std::size_t kUnrelated = kAssignments + kLates, kDegrees = kUnrelated + 1;
  /// Parts of the turns of a gyro in deg/s that may explain those of lidar: all of them if it is one.
  static constexpr std::array kShares{1.0, 0.0, 0.5, 2.0};

  void compare();
  void decide();

  Eigen::Vector3d lidar_rad_ = Eigen::Vector3d::Zero(); ///< sums of turns that have not been compared
  GyroTurns gyro_rad_;
  double elapsed_s_ = 0.0;
  /// -2 log likelihood of assignments, delays, unrelated turns, and kShares of turns in degrees.
  std::array<double, kDegrees + kShares.size()> costs_;
  bool wrong_ = false, decided_ = false, in_degrees_ = false;
  std::optional<Eigen::Matrix3d> axes_;
};

} // namespace locus
