// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "core/base/options.hpp"
#include "core/odometry/motion_filter.hpp"
#include "daemon/odometry_comparison.hpp"

/// Comparison of learned figures with their configuration. Internal to calibration.hpp. Any thread.
namespace locus::daemon {

inline constexpr double kMinDeviation_sigma = 3.0; ///< least deviation of a figure from its configuration
inline constexpr double kObservedRatio = 0.7;      ///< largest ratio of learned to configured sigma, if observed
inline constexpr std::array<std::string_view, 3> kAxisNames{"x (roll)", "y (pitch)", "z (yaw)"};

/// Tells whether the drives determine a figure.
bool is_observed(const Learned& figure, const Learned& configured);

/// Tells whether a figure is observed and deviates from its configuration.
bool is_known_better(const Learned& figure, const Learned& configured);

/// Tells whether samples arrive after the de-skew of the points that they belong to.
bool is_too_late(const MotionSourceOptions& source, const LearnedSource& learned);

/// Returns the configured lateness of an odometry with the deviation that the comparison with lidar assumes.
Learned configured_lateness_s(const MotionSourceOptions& odometry);

/// Returns the lateness that the comparison with lidar found, or the configured one unless the drive determines it.
Learned lateness_s(const MotionSourceOptions& odometry, const std::optional<OdometryFindings>& compared);

} // namespace locus::daemon
