// SPDX-License-Identifier: Apache-2.0
#include "core/sources/axes_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

namespace locus {

namespace {

/// Largest part of a turn about one axis that a mounting error of 8 degrees moves to another.
constexpr double kLeaks = 0.15;

/// Odds, as twice their logarithm, from which the mounting is wrong (it is right a million times as often), and from
/// which an assignment is excluded (a thousand to one).
constexpr double kCertain = 27.6, kExcluded = 13.8;

/// Prior odds, as twice their logarithm, against axes that no mounting explains, those of a faulty driver.
constexpr double kMirrored = 13.8;

/// Time for which errors of lidar and gyro are the same: sweeps within it are no independent evidence.
constexpr double kCorrelated_s = 1.0;

/// Returns an assignment as a matrix with one 1 or -1 in each row and column.
Eigen::Matrix3d assignment(std::size_t index) {
  constexpr std::array<std::array<int, 3>, 6> kOrders{
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (std::size_t row = 0; row < 3; ++row)
    axes(static_cast<int>(row), kOrders[index / 8][row]) = (index >> row & 1U) != 0U ? -1.0 : 1.0;
  return axes;
}

/// Returns -2 log likelihood of a squared error in three axes: Student's t with four degrees of freedom, so that no
/// sweep decides alone.
double cost(double squared) { return (4.0 + 3.0) * std::log(1.0 + squared / 4.0); }

/// Removes what a mounting error of some degrees moves from one axis to another, and noise.
Eigen::Vector3d plain(const Eigen::Vector3d& turn_rad, double noise_rad) {
  return (turn_rad.array().abs() > noise_rad).select(turn_rad, 0.0);
}

} // namespace

AxesCheck::AxesCheck() {
  gyro_rad_.fill(Eigen::Vector3d::Zero());
  costs_.fill(0.0);
  for (std::size_t i = 0; i < kAssignments; ++i)
    costs_[i] = assignment(i).determinant() > 0.0 ? 0.0 : kMirrored;
}

double AxesCheck::noise_rad(const Eigen::Vector3d& gyro_rad, const Eigen::Vector3d& lidar_rad) {
  return std::max(kNoise_rad, kLeaks * std::max(gyro_rad.norm(), lidar_rad.norm()));
}

void AxesCheck::add(const Eigen::Vector3d& lidar_rad, const GyroTurns& gyro_rad, double elapsed_s) {
  if (decided_)
    return;
  lidar_rad_ += lidar_rad;
  for (std::size_t i = 0; i < kLates; ++i)
    gyro_rad_[i] += gyro_rad[i];
  elapsed_s_ += elapsed_s;
  const Eigen::Vector3d& in_time_rad = gyro_rad_[kLates / 2];
  const double most_rad = std::max(lidar_rad_.cwiseAbs().maxCoeff(), in_time_rad.cwiseAbs().maxCoeff());
  if (most_rad < noise_rad(in_time_rad, lidar_rad_) && elapsed_s_ < kCorrelated_s)
    return;
  compare();
  lidar_rad_.setZero();
  gyro_rad_.fill(Eigen::Vector3d::Zero());
  elapsed_s_ = 0.0;
  decide();
}

void AxesCheck::compare() {
  const double noise = noise_rad(gyro_rad_[kLates / 2], lidar_rad_), weight = std::min(1.0, elapsed_s_ / kCorrelated_s);
  const Eigen::Vector3d lidar = plain(lidar_rad_, noise) / noise;
  const auto gyro = [&](std::size_t late) { return Eigen::Vector3d{plain(gyro_rad_[late], noise) / noise}; };
  const Eigen::Vector3d in_time = gyro(kLates / 2);
  for (std::size_t i = 0; i < kAssignments; ++i)
    costs_[i] += weight * cost((lidar - assignment(i) * in_time).squaredNorm());
  for (std::size_t i = 0; i < kLates; ++i)
    costs_[kAssignments + i] += weight * cost((lidar - gyro(i)).squaredNorm());
  costs_[kUnrelated] += weight * cost(0.5 * (lidar.squaredNorm() + in_time.squaredNorm()));

  const Eigen::Vector3d degrees_rad = kRadPerDeg * gyro_rad_[kLates / 2];
  const double noise_in_degrees = noise_rad(degrees_rad, lidar_rad_);
  for (std::size_t i = 0; i < kShares.size(); ++i) {
    const Eigen::Vector3d difference = plain(lidar_rad_ - kShares[i] * degrees_rad, noise_in_degrees);
    costs_[kDegrees + i] += weight * cost(difference.squaredNorm() / (noise_in_degrees * noise_in_degrees));
  }
}

void AxesCheck::decide() {
  const double as_mounted = std::ranges::min(std::span(costs_).subspan(kAssignments, kLates));
  std::size_t best = 1;
  double second = std::numeric_limits<double>::infinity();
  for (std::size_t i = 2; i < kAssignments; ++i)
    if (costs_[i] < costs_[best])
      second = costs_[std::exchange(best, i)];
    else
      second = std::min(second, costs_[i]);
  wrong_ = wrong_ || std::min(as_mounted, costs_[kUnrelated]) - costs_[best] > kCertain;
  const double otherwise = std::min(as_mounted, std::ranges::min(std::span(costs_).subspan(kDegrees + 1)));
  in_degrees_ = in_degrees_ || otherwise - costs_[kDegrees] > kCertain;
  if (wrong_ && second - costs_[best] > kExcluded)
    axes_ = assignment(best);
  decided_ = axes_ || (!wrong_ && costs_[best] - as_mounted > kExcluded);
}

} // namespace locus
