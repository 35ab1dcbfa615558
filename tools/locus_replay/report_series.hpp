// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace locus::tools {

/// Series drawn over time or over the ground, with no more points than a screen can show. Each function returns an
/// object of columns, as the page of the report reads it. Values that are not finite are dropped.

/// Value at a time.
struct Sample {
  double t_s;
  double value;
};

/// Returns `{t, v}` in steps of `resolution`: the extremes of each of `kSeriesBuckets` equal chunks of samples, in
/// their order, so that no peak is lost.
inline constexpr std::size_t kSeriesBuckets = 1200;
nlohmann::ordered_json series(std::span<const Sample> samples, double resolution);

/// Position at a time.
struct PathPoint {
  double t_s;
  Eigen::Vector3d position_m;
};

/// Returns `{t, x, y, z}` rounded to the millimetre, in steps that look smooth: at most `kPathPoints`, and both ends.
inline constexpr std::size_t kPathPoints = 20'000;
nlohmann::ordered_json path(std::vector<PathPoint> points);

/// State at a time: the smaller, the worse.
struct BandSample {
  double t_s;
  int what;
};

/// Returns `{t, what}`: the start of each state, which lasts until the next one. The worst of each of `kSeriesBuckets`
/// equal chunks of samples, so that no short failure is lost.
nlohmann::ordered_json band(std::span<const BandSample> samples);

} // namespace locus::tools
