// SPDX-License-Identifier: Apache-2.0
// Points of a sweep: selection of the returns of each packet, and the filters at its end.
#include <algorithm>
#include <limits>

#include "core/ingest/sweep_builder.hpp"

namespace locus {

namespace {

/// Selects the returns of a firing group: -1 for one fired in [first_ns, last_ns) and within range, else 0. Adds the
/// number fired in that time to `fired`.
RingSegments::Mask select(const FiringGroup& group, std::int32_t first_ns, std::int32_t last_ns, float min_range_m,
                          float max_range_m, std::size_t& fired) {
  RingSegments::Mask counts;
  std::int32_t number = 0;
  // Masks instead of conditions: with branches the compiler does not vectorise the loop.
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const float range_m = group.range_m[k];
    const std::int32_t offset_ns = group.offset_ns[k];
    const std::int32_t is_return = -(range_m > 0.0F) & -(offset_ns >= first_ns) & -(offset_ns < last_ns);
    number -= is_return;
    counts[k] = is_return & -(range_m >= min_range_m) & -(range_m <= max_range_m);
  }
  fired += static_cast<std::size_t>(number);
  return counts;
}

} // namespace

/// Deselects the returns that hit the robot itself.
void SweepBuilder::leave_out_body(const Pose& T_base_lidar, const FiringGroup& group,
                                  RingSegments::Mask& counts) const {
  const BodyBoxOptions& box = options_.body_box;
  const Eigen::Matrix3f R = T_base_lidar.R().cast<float>();
  const Eigen::Vector3f t = T_base_lidar.translation.cast<float>();
  const Eigen::Array3f min_m = box.min_m.cast<float>(), max_m = box.max_m.cast<float>();
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const Eigen::Array3f p_base = R * Eigen::Vector3f{group.x_m[k], group.y_m[k], group.z_m[k]} + t;
    if ((p_base > min_m).all() && (p_base < max_m).all())
      counts[k] = 0;
  }
}

/// Adds the returns fired in [from, to).
void SweepBuilder::append(const LidarPacket& packet, Stamp from, Stamp to) {
  const PacketMotion motion = motion_of(packet);
  segments_.begin_packet(packet.lidar, motion);
  constexpr std::int32_t kAhead = std::numeric_limits<std::int32_t>::min();
  // The first part includes returns fired ahead of the stamp.
  const std::int32_t first_ns =
      from == packet.stamp ? kAhead : static_cast<std::int32_t>((from - packet.stamp).count());
  const auto last_ns = static_cast<std::int32_t>((to - packet.stamp).count());
  const auto min_range_m = static_cast<float>(options_.min_range_m);
  const auto max_range_m = static_cast<float>(options_.max_range_m);
  for (const FiringGroup& group : packet.firing_groups()) {
    RingSegments::Mask counts;
    run_as(options_.isa,
           [&] { counts = select(group, first_ns, last_ns, min_range_m, max_range_m, sweep_.raw_returns); });
    if (options_.body_box.enabled)
      leave_out_body(T_base_lidar_[packet.lidar], group, counts);
    counters_.overflowed_points += segments_.add(packet.lidar, group, counts);
    if (keeps_singly())
      keep_singly(packet.lidar, group, counts, motion);
  }
  window_->last_firing = std::max(window_->last_firing, to);
}

bool SweepBuilder::keeps_singly() const { return !options_.segment_filter.enabled || options_.keeps_returns; }

/// Stores the individual returns; their segments only provide normals.
void SweepBuilder::keep_singly(std::size_t lidar, const FiringGroup& group, const RingSegments::Mask& counts,
                               const PacketMotion& motion) {
  for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
    const std::uint32_t segment = segments_.latest(lidar, group.first_laser + k);
    if (counts[k] == 0 || segment == RingSegments::kNone)
      continue;
    if (raw_.size() == max_returns_) {
      ++counters_.overflowed_points;
      continue;
    }
    const LidarReturn r = group[k];
    const float time_s = motion.stamp_s + 1e-9F * static_cast<float>(r.offset_ns);
    raw_.push_back({{motion.place({r.x_m, r.y_m, r.z_m}, time_s), Eigen::Vector3f::Zero(), time_s,
                     static_cast<float>(r.intensity), static_cast<std::uint16_t>(lidar * 256U + r.ring)},
                    segment});
  }
}

/// Applies the filters to the sweep. Normals are estimated on the segments, before any other filter.
void SweepBuilder::reduce(float duration_s) {
  segments_.finish(duration_s, sweep_.points);
  {
    const StageScope scope(clock_, Stage::covariance);
    normals_.estimate(sweep_.points);
  }
  if (keeps_singly())
    copy_returns(duration_s);
  if (options_.voxel_filter.enabled)
    voxel_filter_.apply(sweep_.points);
  if (options_.random_filter.enabled)
    random_filter_.apply(sweep_.points);
  sweep_.registered = sweep_.points.size();
  if (options_.segment_filter.enabled && sweep_.points.size() > segments_.points_wanted())
    choose_registered();
}

/// Copies the individually stored returns to the sweep, with the normals of their segments.
void SweepBuilder::copy_returns(float duration_s) {
  for (RawPoint& raw : raw_) {
    if (const std::uint32_t place = segments_.place_of(raw.segment); place != RingSegments::kNone)
      raw.point.normal_base = sweep_.points[place].normal_base;
    raw.point.age_s = duration_s - raw.point.age_s;
  }
  std::vector<SweepPoint>& target = options_.segment_filter.enabled ? sweep_.returns : sweep_.points;
  target.clear();
  for (const RawPoint& raw : raw_)
    target.push_back(raw.point);
  raw_.clear();
  if (options_.keeps_returns && !options_.segment_filter.enabled)
    sweep_.returns = sweep_.points;
}

/// Moves the requested number of points to the front, or slightly fewer, evenly selected along each scan line. A line
/// starts at a phase of its own, not at that where the last one ended: a single point more, due to rounding, would
/// change most of the choice on all later lines, and the registration by a millimetre.
void SweepBuilder::choose_registered() {
  constexpr std::size_t kGolden = 40503, kOne = 65536; // the golden ratio spreads the phases evenly
  const std::size_t wanted = segments_.points_wanted();
  const std::size_t total = sweep_.points.size();
  unregistered_.clear();
  sweep_.registered = 0;
  std::size_t phase = 0; // how far the next point is due, 0 .. total
  for (std::size_t i = 0; i < total; ++i) {
    const std::size_t line = sweep_.points[i].scan_line;
    if (i == 0 || line != sweep_.points[i - 1].scan_line)
      phase = line * kGolden % kOne * total / kOne;
    phase += wanted;
    if (phase >= total && sweep_.registered < wanted)
      sweep_.points[sweep_.registered++] = sweep_.points[i];
    else
      unregistered_.push_back(sweep_.points[i]);
    phase %= total;
  }
  std::ranges::copy(unregistered_, sweep_.points.begin() + static_cast<std::ptrdiff_t>(sweep_.registered));
}

} // namespace locus
