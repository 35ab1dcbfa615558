// SPDX-License-Identifier: Apache-2.0
#include "core/ring_segments.hpp"

#include <algorithm>

namespace locus {

namespace {

/// A segment whose centroid lies farther than this from the middle of its ends goes round a corner; it lies on no
/// surface.
constexpr float kMaxBend_m = 0.04F;

constexpr std::size_t kLinesPerLidar = 256;
constexpr float kMinLeaf_m = 0.1F;
constexpr float kMaxLeaf_m = 0.4F;

/// A step in range larger than this between neighbouring returns is another surface.
constexpr float kRangeJump_m = 0.1F;
constexpr float kRangeJumpPerRange = 0.02F;

} // namespace

RingSegments::RingSegments(std::size_t lidars, std::size_t points_wanted)
    : points_wanted_(points_wanted), leaf_m_(kMinLeaf_m), lines_(lidars * kLinesPerLidar),
      line_begin_(lines_.size() + 1) {
  segments_.reserve(kMaxSegments);
  place_.reserve(kMaxSegments);
}

std::uint32_t RingSegments::add(std::uint16_t scan_line, const Eigen::Vector3f& position_m, float range_m, float time_s,
                                float intensity) {
  Line& line = lines_[scan_line];
  const bool same_surface = line.open != kNone &&
                            std::abs(range_m - line.last_range_m) < kRangeJump_m + kRangeJumpPerRange * range_m &&
                            (position_m - segments_[line.open].first_m).squaredNorm() < leaf_m_ * leaf_m_;
  line.last_range_m = range_m;
  if (!same_surface) {
    if (segments_.size() == kMaxSegments)
      return kNone;
    line.open = static_cast<std::uint32_t>(segments_.size());
    segments_.push_back({position_m, position_m, position_m, time_s, intensity, 1.0F, scan_line});
    return line.open;
  }
  Segment& segment = segments_[line.open];
  segment.last_m = position_m;
  segment.sum_m += position_m;
  segment.time_sum_s += time_s;
  segment.intensity_sum += intensity;
  segment.count += 1.0F;
  return line.open;
}

bool RingSegments::bends(const Segment& segment) {
  const Eigen::Vector3f middle = 0.5F * (segment.first_m + segment.last_m);
  return (segment.sum_m / segment.count - middle).squaredNorm() > kMaxBend_m * kMaxBend_m;
}

void RingSegments::finish(float duration_s, std::vector<SweepPoint>& points) {
  std::fill(line_begin_.begin(), line_begin_.end(), 0U);
  std::size_t straight = 0;
  for (const Segment& segment : segments_) {
    if (bends(segment))
      continue;
    ++line_begin_[segment.scan_line + 1U];
    ++straight;
  }
  for (std::size_t i = 1; i < line_begin_.size(); ++i)
    line_begin_[i] += line_begin_[i - 1];

  points.resize(straight);
  place_.resize(segments_.size());
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& segment = segments_[i];
    place_[i] = kNone;
    if (bends(segment))
      continue;
    const float share = 1.0F / segment.count;
    place_[i] = line_begin_[segment.scan_line]++;
    points[place_[i]] = {share * segment.sum_m, Eigen::Vector3f::Zero(), duration_s - share * segment.time_sum_s,
                         share * segment.intensity_sum, segment.scan_line};
  }

  const float surplus = static_cast<float>(segments_.size()) / static_cast<float>(points_wanted_);
  if (!segments_.empty())
    leaf_m_ = std::clamp(leaf_m_ * std::clamp(surplus, 0.5F, 2.0F), kMinLeaf_m, kMaxLeaf_m);
  segments_.clear();
  std::fill(lines_.begin(), lines_.end(), Line{});
}

} // namespace locus
