// SPDX-License-Identifier: Apache-2.0
#include "core/ring_segments.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace locus {

namespace {

/// A segment whose centroid lies farther than this from the middle of its ends goes round a corner; it lies on no
/// surface.
constexpr float kMaxBend_m = 0.04F;

constexpr std::size_t kLinesPerLidar = 256;
constexpr float kFirstLeaf_m = 0.1F;
constexpr float kMinLeaf_m = 0.05F;
constexpr float kMaxLeaf_m = 0.4F;

/// A step in range larger than this between neighbouring returns is another surface.
constexpr float kRangeJump_m = 0.1F;
constexpr float kRangeJumpPerRange = 0.02F;

/// Calls `visit` with each place where the mask is set.
template <class Visit> void for_each_set(const RingSegments::Mask& mask, const Visit& visit) {
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < mask.size(); ++k)
    bits |= static_cast<std::uint32_t>(mask[k]) & 1U << k;
  for (; bits != 0; bits &= bits - 1)
    visit(static_cast<std::size_t>(std::countr_zero(bits)));
}

} // namespace

RingSegments::RingSegments(std::size_t lidars, std::size_t points_wanted)
    : points_wanted_(points_wanted), leaf_m_(kFirstLeaf_m), lidars_(lidars), line_begin_(lidars * kLinesPerLidar + 1) {
  segments_.reserve(kMaxSegments);
  place_.reserve(kMaxSegments);
}

void RingSegments::begin_packet(std::size_t lidar, const PacketMotion& motion) {
  Lidar& at = lidars_[lidar];
  at.motion = motion;
  ++at.packet;
  for (Bank& bank : at.banks()) {
    Mask abandoned;
    for (std::size_t k = 0; k < Salvo::kLasers; ++k)
      abandoned[k] = bank.count[k] > 0.0F && bank.last_packet[k] + 1 < at.packet ? -1 : 0;
    for_each_set(abandoned, [&](std::size_t k) { close(lidar, bank, k); });
  }
}

/// Where a return that counts does not go on with the open segment of its laser.
RingSegments::Mask RingSegments::beginnings(const Bank& bank, const Salvo& salvo, const Mask& counts) const {
  Mask begins;
  for (std::size_t k = 0; k < Salvo::kLasers; ++k) {
    const float dx = salvo.x_m[k] - bank.first_x[k];
    const float dy = salvo.y_m[k] - bank.first_y[k];
    const float dz = salvo.z_m[k] - bank.first_z[k];
    const float step_m = std::abs(salvo.range_m[k] - bank.last_range_m[k]);
    const float max_step_m = kRangeJump_m + kRangeJumpPerRange * salvo.range_m[k];
    const bool is_open = bank.count[k] > 0.0F;
    const bool same_surface =
        is_open & (step_m < max_step_m) & (dx * dx + dy * dy + dz * dz < leaf_m_ * leaf_m_); // no branch in the loop
    begins[k] = same_surface ? 0 : counts[k];
  }
  return begins;
}

std::size_t RingSegments::add(std::size_t lidar, const Salvo& salvo, const Mask& counts) {
  const std::size_t place = salvo.first_laser / Salvo::kLasers;
  lidars_[lidar].banks_used = std::max(lidars_[lidar].banks_used, place + 1);
  Bank& bank = lidars_[lidar].storage[place];
  const PacketMotion& motion = lidars_[lidar].motion;
  const std::int32_t packet = lidars_[lidar].packet;
  Mask takes = counts;
  std::size_t refused = 0;
  const Mask begins = beginnings(bank, salvo, counts);
  for_each_set(begins, [&](std::size_t k) {
    if (bank.count[k] > 0.0F)
      close(lidar, bank, k);
    bank.id[k] = open();
    bank.ring[k] = salvo.ring[k];
    if (bank.id[k] == kNone) {
      takes[k] = 0;
      ++refused;
    }
  });
  for (std::size_t k = 0; k < Salvo::kLasers; ++k) {
    const float x = salvo.x_m[k], y = salvo.y_m[k], z = salvo.z_m[k];
    const float time_s = motion.stamp_s + 1e-9F * static_cast<float>(salvo.offset_ns[k]);
    const auto intensity = static_cast<float>(salvo.intensity[k]);
    const bool takes_it = takes[k] != 0;
    const bool begins_here = (begins[k] & takes[k]) != 0;
    const float earlier = begins_here ? 0.0F : 1.0F; // what the open segment had goes on to count
    const float share = takes_it ? 1.0F : 0.0F;
    bank.first_x[k] = begins_here ? x : bank.first_x[k];
    bank.first_y[k] = begins_here ? y : bank.first_y[k];
    bank.first_z[k] = begins_here ? z : bank.first_z[k];
    bank.last_x[k] = takes_it ? x : bank.last_x[k];
    bank.last_y[k] = takes_it ? y : bank.last_y[k];
    bank.last_z[k] = takes_it ? z : bank.last_z[k];
    bank.sum_x[k] = earlier * bank.sum_x[k] + share * x;
    bank.sum_y[k] = earlier * bank.sum_y[k] + share * y;
    bank.sum_z[k] = earlier * bank.sum_z[k] + share * z;
    bank.time_sum_s[k] = earlier * bank.time_sum_s[k] + share * time_s;
    bank.intensity_sum[k] = earlier * bank.intensity_sum[k] + share * intensity;
    bank.count[k] = earlier * bank.count[k] + share;
    bank.last_range_m[k] = counts[k] != 0 ? salvo.range_m[k] : bank.last_range_m[k];
    bank.last_packet[k] = takes_it ? packet : bank.last_packet[k];
  }
  return refused;
}

std::uint32_t RingSegments::latest(std::size_t lidar, std::size_t laser) const {
  return lidars_[lidar].storage[laser / Salvo::kLasers].id[laser % Salvo::kLasers];
}

std::uint32_t RingSegments::open() { return opened_ < kMaxSegments ? opened_++ : kNone; }

/// Leaves out a segment that goes round a corner.
void RingSegments::close(std::size_t lidar, Bank& bank, std::size_t laser) {
  const std::size_t k = laser;
  const float share = 1.0F / bank.count[k];
  const Eigen::Vector3f mean_m = share * Eigen::Vector3f{bank.sum_x[k], bank.sum_y[k], bank.sum_z[k]};
  const Eigen::Vector3f ends_m{bank.first_x[k] + bank.last_x[k], bank.first_y[k] + bank.last_y[k],
                               bank.first_z[k] + bank.last_z[k]};
  bank.count[k] = 0.0F;
  if ((mean_m - 0.5F * ends_m).squaredNorm() > kMaxBend_m * kMaxBend_m)
    return;
  const float time_s = share * bank.time_sum_s[k];
  const auto scan_line = static_cast<std::uint16_t>(lidar * kLinesPerLidar + bank.ring[k]);
  segments_.push_back({{lidars_[lidar].motion.place(mean_m, time_s), Eigen::Vector3f::Zero(), time_s,
                        share * bank.intensity_sum[k], scan_line},
                       bank.id[k]});
}

void RingSegments::finish(float duration_s, std::vector<SweepPoint>& points) {
  for (std::size_t lidar = 0; lidar < lidars_.size(); ++lidar) {
    for (Bank& bank : lidars_[lidar].banks()) {
      for (std::size_t k = 0; k < Salvo::kLasers; ++k)
        if (bank.count[k] > 0.0F)
          close(lidar, bank, k);
    }
    lidars_[lidar].packet = 0;
  }
  std::fill(line_begin_.begin(), line_begin_.end(), 0U);
  for (const Segment& segment : segments_)
    ++line_begin_[segment.point.scan_line + 1U];
  for (std::size_t i = 1; i < line_begin_.size(); ++i)
    line_begin_[i] += line_begin_[i - 1];

  points.resize(segments_.size());
  place_.assign(opened_, kNone);
  for (const Segment& segment : segments_) {
    const std::uint32_t place = line_begin_[segment.point.scan_line]++;
    place_[segment.id] = place;
    points[place] = segment.point;
    points[place].age_s = duration_s - segment.point.age_s;
  }

  const float surplus = static_cast<float>(opened_) / static_cast<float>(points_wanted_);
  if (opened_ > 0)
    leaf_m_ = std::clamp(leaf_m_ * std::clamp(surplus, 0.5F, 2.0F), kMinLeaf_m, kMaxLeaf_m);
  segments_.clear();
  opened_ = 0;
}

} // namespace locus
