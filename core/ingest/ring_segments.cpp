// SPDX-License-Identifier: Apache-2.0
#include "core/ingest/ring_segments.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace locus {

namespace {

/// Largest distance of a segment's centroid from the midpoint of its ends. A segment beyond it goes round a corner and
/// lies on no surface.
constexpr float kMaxBend_m = 0.04F;

/// Points wanted of a sweep, unless their number is requested: with many lines, 2000 points are so few per line that
/// the choice of them moves the estimate by millimetres.
constexpr std::size_t kPoints = 2000;
constexpr std::size_t kPointsPerLine = 50;

constexpr std::size_t kLinesPerLidar = 256;
constexpr float kFirstLeaf_m = 0.1F;
constexpr float kMinLeaf_m = 0.05F;
constexpr float kMaxLeaf_m = 0.4F;

/// Largest step in range between neighbouring returns of one surface.
constexpr float kRangeJump_m = 0.1F;
constexpr float kRangeJumpPerRange = 0.02F;

/// Packs a mask into one bit per laser.
std::uint32_t bits_of(const RingSegments::Mask& mask) {
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < mask.size(); ++k)
    bits |= static_cast<std::uint32_t>(mask[k]) & 1U << k;
  return bits;
}

/// Calls `visit` with the index of each set bit.
template <class Visit> void for_each_set(std::uint32_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1)
    visit(static_cast<std::size_t>(std::countr_zero(bits)));
}

} // namespace

RingSegments::RingSegments(std::size_t lidars, std::optional<std::size_t> points_wanted, Isa isa)
    : isa_(isa), points_requested_(points_wanted), points_wanted_(points_wanted.value_or(kPoints)),
      leaf_m_(kFirstLeaf_m), lidars_(lidars), line_begin_(lidars * kLinesPerLidar + 1) {
  segments_.reserve(kMaxSegments);
  place_.reserve(kMaxSegments);
}

void RingSegments::begin_packet(std::size_t lidar, const PacketMotion& motion) {
  Lidar& at = lidars_[lidar];
  at.motion = motion;
  ++at.packet;
  for (Bank& bank : at.banks()) {
    Mask abandoned;
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
      abandoned[k] = bank.count[k] > 0.0F && bank.last_packet[k] + 1 < at.packet ? -1 : 0;
    for_each_set(bits_of(abandoned), [&](std::size_t k) { close(lidar, bank, k); });
  }
}

/// Marks the selected returns that do not continue the open segment of their laser.
[[gnu::always_inline]] inline RingSegments::Mask RingSegments::beginnings_in(const Bank& bank, const FiringGroup& group,
                                                                             const Mask& counts) const {
  Mask begins;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const float dx = group.x_m[k] - bank.first_x[k];
    const float dy = group.y_m[k] - bank.first_y[k];
    const float dz = group.z_m[k] - bank.first_z[k];
    const float step_m = std::abs(group.range_m[k] - bank.last_range_m[k]);
    const float max_step_m = kRangeJump_m + kRangeJumpPerRange * group.range_m[k];
    const bool is_open = bank.count[k] > 0.0F;
    const bool same_surface =
        is_open & (step_m < max_step_m) & (dx * dx + dy * dy + dz * dz < leaf_m_ * leaf_m_); // no branch in the loop
    begins[k] = same_surface ? 0 : counts[k];
  }
  return begins;
}

std::size_t RingSegments::add(std::size_t lidar, const FiringGroup& group, const Mask& counts) {
  const std::size_t place = group.first_laser / FiringGroup::kLasers;
  lidars_[lidar].banks_used = std::max(lidars_[lidar].banks_used, place + 1);
  Bank& bank = lidars_[lidar].storage[place];
  Mask begins, accepted = counts;
  std::uint32_t beginnings = 0;
  run_as(isa_, [&] {
    begins = beginnings_in(bank, group, counts);
    beginnings = bits_of(begins);
  });
  std::size_t refused = 0;
  for_each_set(beginnings, [&](std::size_t k) {
    if (bank.count[k] > 0.0F)
      close(lidar, bank, k);
    bank.id[k] = open();
    bank.ring[k] = group.ring[k];
    if (bank.id[k] == kNone) {
      accepted[k] = 0;
      ++refused;
    }
  });
  run_as(isa_, [&] { bank.add(group, begins, accepted, lidars_[lidar].motion.stamp_s, lidars_[lidar].packet); });
  return refused;
}

/// Adds the returns selected by `accepted`; those in `begins` are the first of their segments. Sums instead of
/// branches, and inputs by value: otherwise the loop is not vectorised.
[[gnu::always_inline]] inline void RingSegments::Bank::add(FiringGroup group, Mask begins, Mask accepted, float stamp_s,
                                                           std::int32_t packet) {
  PerLaser<float> intensity;
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
    intensity[k] = static_cast<float>(group.intensity[k]);
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const float x = group.x_m[k], y = group.y_m[k], z = group.z_m[k];
    const float time_s = stamp_s + 1e-9F * static_cast<float>(group.offset_ns[k]);
    const auto share = static_cast<float>(-accepted[k]), rest = 1.0F - share;
    const auto is_first = static_cast<float>(-(begins[k] & accepted[k])), earlier = 1.0F - is_first;
    first_x[k] = earlier * first_x[k] + is_first * x;
    first_y[k] = earlier * first_y[k] + is_first * y;
    first_z[k] = earlier * first_z[k] + is_first * z;
    last_x[k] = rest * last_x[k] + share * x;
    last_y[k] = rest * last_y[k] + share * y;
    last_z[k] = rest * last_z[k] + share * z;
    sum_x[k] = earlier * sum_x[k] + share * x;
    sum_y[k] = earlier * sum_y[k] + share * y;
    sum_z[k] = earlier * sum_z[k] + share * z;
    time_sum_s[k] = earlier * time_sum_s[k] + share * time_s;
    intensity_sum[k] = earlier * intensity_sum[k] + share * intensity[k];
    count[k] = earlier * count[k] + share;
    last_range_m[k] = rest * last_range_m[k] + share * group.range_m[k];
    last_packet[k] = (last_packet[k] & ~accepted[k]) | (packet & accepted[k]);
  }
}

std::uint32_t RingSegments::latest(std::size_t lidar, std::size_t laser) const {
  return lidars_[lidar].storage[laser / FiringGroup::kLasers].id[laser % FiringGroup::kLasers];
}

std::uint32_t RingSegments::open() { return opened_ < kMaxSegments ? opened_++ : kNone; }

/// Closes a segment; drops it if it goes round a corner.
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
      for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
        if (bank.count[k] > 0.0F)
          close(lidar, bank, k);
    }
    lidars_[lidar].packet = 0;
  }
  std::fill(line_begin_.begin(), line_begin_.end(), 0U);
  for (const Segment& segment : segments_)
    ++line_begin_[segment.point.scan_line + 1U];
  const auto lines = line_begin_.size() - static_cast<std::size_t>(std::ranges::count(line_begin_, 0U));
  points_wanted_ = points_requested_.value_or(std::max(kPoints, kPointsPerLine * lines));
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
