// SPDX-License-Identifier: Apache-2.0
#include "accuracy/trajectory_accuracy.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "accuracy/pose_pairs.hpp"

namespace locus {
namespace {

/// Points fixed to the base, centred on it: they carry its attitude into the alignment.
const std::array<Eigen::Vector3d, 4> kAroundBase{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}};

/// Aligns points fixed to the base by least squares (Umeyama, 1991), without storing them all.
Pose aligned(std::span<const PosePair> pairs, std::span<const Eigen::Vector3d> points_base) {
  const auto for_each_point = [&](auto&& visit) {
    for (const PosePair& pair : pairs) {
      for (const Eigen::Vector3d& point : points_base)
        visit(Eigen::Vector3d{pair.T_odom_base * point}, Eigen::Vector3d{pair.T_truth_base * point});
    }
  };
  const auto count = static_cast<double>(pairs.size() * points_base.size());
  Eigen::Vector3d odom_mean = Eigen::Vector3d::Zero(), truth_mean = Eigen::Vector3d::Zero();
  for_each_point([&](const Eigen::Vector3d& odom, const Eigen::Vector3d& truth) {
    odom_mean += odom / count;
    truth_mean += truth / count;
  });
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for_each_point([&](const Eigen::Vector3d& odom, const Eigen::Vector3d& truth) {
    covariance += (truth - truth_mean) * (odom - odom_mean).transpose();
  });
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d no_mirror{1, 1, svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1.0 : 1.0};
  const Eigen::Matrix3d R = svd.matrixU() * no_mirror.asDiagonal() * svd.matrixV().transpose();
  return {Eigen::Quaterniond{R}, truth_mean - R * odom_mean};
}

struct StretchError {
  double percent, deg;
};

StretchError error_of(std::span<const PosePair> pairs, const Stretch& stretch) {
  const PosePair &begin = pairs[stretch.begin], &end = pairs[stretch.end];
  const Pose T_truth = begin.T_truth_base.inverse() * end.T_truth_base;
  const Pose error = T_truth.inverse() * (begin.T_odom_base.inverse() * end.T_odom_base);
  return {100.0 * error.translation.norm() / stretch.length_m, angle_rad(error.rotation) / kRadPerDeg};
}

/// Returns the mean over all stretches.
std::optional<StretchError> relative_error(std::span<const PosePair> pairs, double length_m) {
  const std::vector<Stretch> stretches = stretches_of(pairs, length_m);
  if (stretches.empty())
    return std::nullopt;
  StretchError sum{0, 0};
  for (const Stretch& stretch : stretches) {
    const StretchError error = error_of(pairs, stretch);
    sum.percent += error.percent;
    sum.deg += error.deg;
  }
  const auto count = static_cast<double>(stretches.size());
  return StretchError{sum.percent / count, sum.deg / count};
}

double end_drift_m(const PosePair& first, const PosePair& last) {
  const Pose T_truth_odom = first.T_truth_base * first.T_odom_base.inverse();
  return (T_truth_odom * last.T_odom_base.translation - last.T_truth_base.translation).norm();
}

} // namespace

ErrorStatistics statistics_of(std::span<const double> errors) {
  if (errors.empty())
    return {};
  const auto count = static_cast<double>(errors.size());
  const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  double squares = 0, squares_about_mean = 0;
  for (const double error : errors) {
    squares += error * error;
    squares_about_mean += (error - mean) * (error - mean);
  }
  return {std::ranges::max(errors), mean, std::sqrt(squares_about_mean / count), std::sqrt(squares / count)};
}

std::optional<TrajectoryAccuracy> trajectory_accuracy(std::span<const StampedPose> estimates,
                                                      std::span<const StampedPose> truth) {
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    return std::nullopt;
  TrajectoryAccuracy accuracy;
  const Pose T_by_positions = aligned(pairs, std::array{Eigen::Vector3d{0, 0, 0}});
  for (const PosePair& pair : pairs) {
    accuracy.stamps.push_back(pair.stamp);
    accuracy.position_error_m.push_back(
        (T_by_positions * pair.T_odom_base.translation - pair.T_truth_base.translation).norm());
  }
  accuracy.ape_m = statistics_of(accuracy.position_error_m);
  if (const std::optional<StretchError> error = relative_error(pairs, 10.0)) {
    accuracy.rpe_10m_percent = error->percent;
    accuracy.rpe_10m_deg = error->deg;
  }
  accuracy.end_drift_m = end_drift_m(pairs.front(), pairs.back());
  accuracy.T_truth_odom = aligned(pairs, kAroundBase);
  return accuracy;
}

std::optional<WayDrift> way_drift(std::span<const StampedPose> estimates, std::span<const StampedPose> truth) {
  constexpr int kShortest_m = 100, kLongest_m = 800;
  constexpr double kMetresPerUnit = 100;
  constexpr std::size_t kEvery = 10;
  const std::vector<PosePair> pairs = paired(estimates, truth);
  if (pairs.empty())
    return std::nullopt;
  WayDrift drift;
  for (std::size_t i = 1; i < pairs.size(); ++i)
    drift.way_m += (pairs[i].T_truth_base.translation - pairs[i - 1].T_truth_base.translation).norm();
  double percent = 0, deg_per_100m = 0, count = 0;
  for (int length_m = kShortest_m; length_m <= kLongest_m; length_m += kShortest_m) {
    for (const Stretch& stretch : stretches_of(pairs, length_m)) {
      if (stretch.begin % kEvery != 0)
        continue;
      const StretchError error = error_of(pairs, stretch);
      percent += error.percent;
      deg_per_100m += error.deg * kMetresPerUnit / stretch.length_m;
      ++count;
    }
  }
  if (count > 0) {
    drift.percent = percent / count;
    drift.deg_per_100m = deg_per_100m / count;
  }
  return drift;
}

} // namespace locus
