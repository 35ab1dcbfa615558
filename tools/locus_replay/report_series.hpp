// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace locus::tools {

/// What is drawn over time or over the ground, with no more points than a screen can show. Each function gives an
/// object of columns, as the page of the report reads it. Values that are not finite are left out.

/// One value at one time.
struct Sample {
  double t_s;
  double value;
};

/// `{t, v}` in steps of `resolution`: the extremes of each of `kSeriesBuckets` equal stretches of samples, in their
/// order, so no peak is lost.
inline constexpr std::size_t kSeriesBuckets = 1200;
nlohmann::ordered_json series(std::span<const Sample> samples, double resolution);

/// Where something was at one time.
struct PathPoint {
  double t_s;
  Eigen::Vector3d position_m;
};

/// `{t, x, y, z}` to the millimetre, in steps that still look smooth: at most `kPathPoints` and both ends.
inline constexpr std::size_t kPathPoints = 20'000;
nlohmann::ordered_json path(std::vector<PathPoint> points);

/// What something was at one time: the smaller, the worse.
struct BandSample {
  double t_s;
  int what;
};

/// `{t, what}`: when each state begins, which holds until the next one. The worst of each of `kSeriesBuckets` equal
/// stretches of samples, so no short failure is lost.
nlohmann::ordered_json band(std::span<const BandSample> samples);

} // namespace locus::tools
