// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/report_series.hpp"

#include <algorithm>
#include <cmath>

namespace locus::tools {
namespace {

using nlohmann::ordered_json;

constexpr double kTimeResolution_s = 1e-3;
constexpr double kPathResolution_m = 1e-3;
constexpr double kStepsAcross = 2000; ///< resolution of the path relative to its extent

/// Rounds to a multiple of 1 / steps, which prints with the fewest digits: a product with 1e-3 would have seventeen.
double rounded(double value, double resolution) {
  const double steps = std::round(1.0 / resolution);
  return std::round(value * steps) / steps;
}

/// Calls `visit` with each of at most `count` chunks of equal length.
template <class T, class Visit>
void for_each_stretch(std::span<const T> samples, std::size_t count, const Visit& visit) {
  const std::size_t length = std::max<std::size_t>(1, (samples.size() + count - 1) / count);
  for (std::size_t begin = 0; begin < samples.size(); begin += length)
    visit(samples.subspan(begin, std::min(length, samples.size() - begin)));
}

double smooth_step_m(std::span<const PathPoint> points) {
  Eigen::Vector3d low = points.front().position_m, high = low;
  double length_m = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    low = low.cwiseMin(points[i].position_m);
    high = high.cwiseMax(points[i].position_m);
    length_m += (points[i].position_m - points[i - 1].position_m).norm();
  }
  return std::max((high - low).norm() / kStepsAcross, length_m / static_cast<double>(kPathPoints));
}

} // namespace

ordered_json series(std::span<const Sample> samples, double resolution) {
  std::vector<Sample> finite;
  std::ranges::copy_if(samples, std::back_inserter(finite), [](const Sample& s) { return std::isfinite(s.value); });
  ordered_json t = ordered_json::array(), v = ordered_json::array();
  const auto push = [&](const Sample& sample) {
    t.push_back(rounded(sample.t_s, kTimeResolution_s));
    v.push_back(rounded(sample.value, resolution));
  };
  for_each_stretch(std::span<const Sample>{finite}, kSeriesBuckets, [&](std::span<const Sample> stretch) {
    const auto [low, high] = std::ranges::minmax_element(stretch, {}, &Sample::value);
    push(*std::min(low, high));
    if (low != high)
      push(*std::max(low, high));
  });
  return {{"t", std::move(t)}, {"v", std::move(v)}};
}

ordered_json path(std::vector<PathPoint> points) {
  std::erase_if(points, [](const PathPoint& point) { return !point.position_m.allFinite(); });
  ordered_json t = ordered_json::array(), x = ordered_json::array(), y = ordered_json::array(),
               z = ordered_json::array();
  const auto push = [&](const PathPoint& point) {
    t.push_back(rounded(point.t_s, kTimeResolution_s));
    x.push_back(rounded(point.position_m.x(), kPathResolution_m));
    y.push_back(rounded(point.position_m.y(), kPathResolution_m));
    z.push_back(rounded(point.position_m.z(), kPathResolution_m));
  };
  if (!points.empty()) {
    const double step_m = smooth_step_m(points);
    const PathPoint* kept = points.data();
    push(*kept);
    for (const PathPoint& point : points) {
      const bool is_last = &point == &points.back();
      if (is_last || (point.position_m - kept->position_m).norm() > step_m) {
        push(point);
        kept = &point;
      }
    }
  }
  return {{"t", std::move(t)}, {"x", std::move(x)}, {"y", std::move(y)}, {"z", std::move(z)}};
}

ordered_json band(std::span<const BandSample> samples) {
  ordered_json t = ordered_json::array(), what = ordered_json::array();
  for_each_stretch(samples, kSeriesBuckets, [&](std::span<const BandSample> stretch) {
    const int worst = std::ranges::min(stretch, {}, &BandSample::what).what;
    if (what.empty() || what.back() != worst) {
      t.push_back(rounded(stretch.front().t_s, kTimeResolution_s));
      what.push_back(worst);
    }
  });
  return {{"t", std::move(t)}, {"what", std::move(what)}};
}

} // namespace locus::tools
