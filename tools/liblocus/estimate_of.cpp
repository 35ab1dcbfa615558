// SPDX-License-Identifier: Apache-2.0
#include "liblocus/estimate_of.hpp"

#include <array>
#include <cmath>
#include <cstdint>

#include "locus_replay/prior_name.hpp"

namespace locus::library {
namespace {

std::array<double, 6> array_of(const Vector6& v) { return {v[0], v[1], v[2], v[3], v[4], v[5]}; }

/// Converts row by row.
std::array<double, 36> array_of(const Matrix6& matrix) {
  std::array<double, 36> values{};
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      values[static_cast<std::size_t>(6 * row + column)] = matrix(row, column);
  }
  return values;
}

/// Converts by value: the library lists the states in the same order.
liblocus::State state_of(TrackingState state) {
  using liblocus::State;
  static_assert(State{static_cast<std::uint8_t>(TrackingState::degenerate)} == State::degenerate &&
                State{static_cast<std::uint8_t>(TrackingState::dead_reckoning)} == State::dead_reckoning &&
                State{static_cast<std::uint8_t>(TrackingState::standstill)} == State::standstill);
  return State{static_cast<std::uint8_t>(state)};
}

liblocus::SourceEstimate source_of(const SourceReport& report, const std::string& name) {
  liblocus::SourceEstimate source{.name = name,
                                  .test_ratio = report.test_ratio,
                                  .last_used_ns = to_ns(report.last_used),
                                  .doubted = report.doubted};
  for (std::size_t i = 0; i < source.innovation.size(); ++i) {
    source.innovation[i] = report.innovation.value[static_cast<Eigen::Index>(i)];
    source.innovation_sigma[i] = std::sqrt(report.innovation.variance[static_cast<Eigen::Index>(i)]);
  }
  return source;
}

} // namespace

liblocus::Estimate estimate_of(const OdometryEstimate& estimate, std::span<const std::string> source_names) {
  const Eigen::Vector3d& p = estimate.T_odom_base.translation;
  const Eigen::Quaterniond& q = estimate.T_odom_base.rotation;
  liblocus::Estimate result{
      .stamp_ns = to_ns(estimate.stamp),
      .position_m = {p.x(), p.y(), p.z()},
      .orientation_xyzw = {q.x(), q.y(), q.z(), q.w()},
      .pose_covariance = array_of(estimate.pose_covariance),
      .twist = array_of(estimate.twist_base),
      .twist_covariance = array_of(estimate.twist_covariance),
      .state = state_of(estimate.state),
      .observability = array_of(estimate.observability),
      .prior = tools::name_of(estimate.prior, source_names),
      .points = estimate.points,
      .iterations = static_cast<std::size_t>(estimate.scan_to_submap.iterations),
      .inliers = estimate.scan_to_submap.inliers,
      .keyframe = estimate.keyframe,
      .failed = estimate.failed,
      .sources = {},
  };
  for (std::size_t i = 0; i < source_names.size(); ++i)
    result.sources.push_back(source_of(estimate.sources[i], source_names[i]));
  return result;
}

} // namespace locus::library
