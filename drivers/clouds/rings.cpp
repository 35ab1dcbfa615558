// SPDX-License-Identifier: Apache-2.0
#include "drivers/clouds/rings.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace locus {

namespace {

float elevation_rad(const Rings::Positions& points, std::size_t i) {
  return std::atan2(points.z_m[i], std::hypot(points.x_m[i], points.y_m[i]));
}

} // namespace

void Rings::assign(Positions points, std::span<const float> rings, RingsFrom source,
                   std::vector<std::uint8_t>& lasers) {
  constexpr auto kEnd = static_cast<float>(kMax);
  const bool has_rings =
      !rings.empty() && std::ranges::all_of(rings, [](float ring) { return ring >= 0.0F && ring < kEnd; });
  lasers.clear();
  if (has_rings) {
    from_ = source;
    for (const float ring : rings)
      lasers.push_back(static_cast<std::uint8_t>(ring));
  } else {
    if (!lines_known_)
      find_lines(points);
    for (std::size_t i = 0; i < points.x_m.size(); ++i) {
      const double above_nadir = static_cast<double>(elevation_rad(points, i)) + std::numbers::pi / 2;
      const auto bin = static_cast<std::size_t>(std::max(above_nadir, 0.0) / kBin_rad);
      lasers.push_back(laser_of_bin_[std::min(bin, kBins - 1)]);
    }
  }
  rank(points, lasers);
}

/// Finds the lasers' elevations as peaks of the histogram, with few points between them; each bin belongs to the
/// nearest peak. Without peaks, or with too many, divides the observed elevation range into equal bands.
void Rings::find_lines(Positions points) {
  constexpr std::size_t kFewestPoints = 1000, kFewestLines = 4, kBands = 32, kOneIn = 64;
  const std::size_t count = points.x_m.size();
  from_ = RingsFrom::bands;
  if (count < kFewestPoints)
    return;
  lines_known_ = true;
  histogram_.fill(0);
  for (std::size_t i = 0; i < count; ++i) {
    const double above_nadir = static_cast<double>(elevation_rad(points, i)) + std::numbers::pi / 2;
    ++histogram_[std::min(static_cast<std::size_t>(std::max(above_nadir, 0.0) / kBin_rad), kBins - 1)];
  }
  const std::uint32_t highest = *std::ranges::max_element(histogram_);
  std::array<double, kMax> centres{};
  std::size_t lines = 0;
  for (std::size_t bin = 0; bin < kBins;) {
    if (kOneIn * histogram_[bin] < highest) {
      ++bin;
      continue;
    }
    double sum = 0, weight = 0;
    for (; bin < kBins && kOneIn * histogram_[bin] >= highest; ++bin) {
      sum += static_cast<double>(bin) * histogram_[bin];
      weight += histogram_[bin];
    }
    if (lines < kMax)
      centres[lines] = sum / weight;
    ++lines;
  }
  if (lines >= kFewestLines && lines <= kMax) {
    from_ = RingsFrom::elevation;
  } else {
    const auto is_occupied = [](std::uint32_t points_of_bin) { return points_of_bin > 0; };
    const auto first = std::ranges::find_if(histogram_, is_occupied) - histogram_.begin();
    const auto last = histogram_.rend() - std::find_if(histogram_.rbegin(), histogram_.rend(), is_occupied);
    lines = kBands;
    for (std::size_t band = 0; band < kBands; ++band)
      centres[band] =
          static_cast<double>(first) + (static_cast<double>(band) + 0.5) / kBands * static_cast<double>(last - first);
  }
  std::size_t line = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    const auto at = static_cast<double>(bin);
    while (line + 1 < lines && std::abs(centres[line + 1] - at) < std::abs(centres[line] - at))
      ++line;
    laser_of_bin_[bin] = static_cast<std::uint8_t>(line);
  }
}

/// Orders the lasers by mean elevation. Recomputed only while new lasers appear, since elevations in the lidar's frame
/// are constant.
void Rings::rank(Positions points, std::span<const std::uint8_t> lasers) {
  bool is_new = false;
  for (const std::uint8_t laser : lasers)
    is_new = is_new || counts_[laser] == 0;
  if (!is_new)
    return;
  for (std::size_t i = 0; i < lasers.size(); ++i) {
    elevation_sum_rad_[lasers[i]] += static_cast<double>(elevation_rad(points, i));
    ++counts_[lasers[i]];
  }
  std::array<std::uint8_t, kMax> by_elevation{};
  std::iota(by_elevation.begin(), by_elevation.end(), std::uint8_t{0});
  const auto end =
      std::partition(by_elevation.begin(), by_elevation.end(), [&](std::uint8_t laser) { return counts_[laser] > 0; });
  const auto mean_rad = [&](std::uint8_t laser) {
    return elevation_sum_rad_[laser] / static_cast<double>(counts_[laser]);
  };
  std::sort(by_elevation.begin(), end, [&](std::uint8_t a, std::uint8_t b) { return mean_rad(a) < mean_rad(b); });
  for (std::size_t i = 0; i < kMax; ++i)
    ring_of_[by_elevation[i]] = static_cast<std::uint8_t>(i);
}

} // namespace locus
