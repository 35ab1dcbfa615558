// SPDX-License-Identifier: Apache-2.0
#include "core/sources/motion_track.hpp"

#include <algorithm>

namespace locus {

MotionTrack::MotionTrack(const MotionSourceOptions& options)
    : kind_(options.kind), late_(applied_lateness(1e-3 * options.late_ms)), T_base_source_(options.T_base_source),
      nodes_(kCapacity) {}

Duration MotionTrack::applied_lateness(double late_s) {
  constexpr double kMostLate_s = 0.015;
  return from_seconds(std::min(kMostLate_s, late_s));
}

void MotionTrack::add(const ImuSample& sample) {
  const Eigen::Vector3d angular_velocity_base = T_base_source_.rotation * sample.angular_velocity_radps;
  Node node{sample.stamp, Pose{}, T_base_source_.rotation * sample.specific_force_mps2, {}};
  if (sample.attitude)
    node.up_base = T_base_source_.rotation * (sample.attitude->conjugate() * Eigen::Vector3d::UnitZ());
  if (size_ > 0) {
    const Node& last = from_newest(0);
    const Eigen::Vector3d mean = 0.5 * (last_angular_velocity_base_radps_ + angular_velocity_base);
    const Eigen::Vector3d turn_rad = to_seconds(sample.stamp - last.stamp) * mean;
    node.T_source_base.rotation = (last.T_source_base.rotation * so3_exp(turn_rad)).normalized();
  }
  last_angular_velocity_base_radps_ = angular_velocity_base;
  push(node);
}

void MotionTrack::add(const OdometrySample& sample) {
  push({sample.stamp, Pose{sample.T_source_base.rotation.normalized(), sample.T_source_base.translation}, {}, {}});
}

void MotionTrack::push(const Node& node) {
  newest_ = (newest_ + 1) % kCapacity;
  nodes_[newest_] = node;
  size_ = std::min(size_ + 1, kCapacity);
}

const MotionTrack::Node& MotionTrack::from_newest(std::size_t age) const {
  return nodes_[(newest_ + kCapacity - age) % kCapacity];
}

std::size_t MotionTrack::age_at(Stamp stamp) const {
  std::size_t younger = 0;
  std::size_t older = size_;
  while (younger < older) {
    const std::size_t middle = (younger + older) / 2;
    if (from_newest(middle).stamp <= stamp)
      older = middle;
    else
      younger = middle + 1;
  }
  return younger;
}

std::optional<Pose> MotionTrack::at(Stamp stamp) const {
  stamp += late_;
  const std::size_t age = age_at(stamp);
  if (age == size_ || stamp > from_newest(0).stamp + kMaxExtrapolation)
    return std::nullopt;
  if (age == 0)
    return extrapolated(stamp);
  return between(from_newest(age), from_newest(age - 1), stamp);
}

/// Precondition: there is a sample, and `stamp` is not before the newest.
Pose MotionTrack::extrapolated(Stamp stamp) const {
  const Node& newest = from_newest(0);
  std::size_t age = 1;
  while (kind_ == SourceKind::odometry && age < size_ && newest.stamp - from_newest(age).stamp < kShortestBaseline)
    ++age;
  return age < size_ ? between(from_newest(age), newest, stamp) : newest.T_source_base;
}

/// Interpolates or extrapolates on the line through two nodes.
Pose MotionTrack::between(const Node& before, const Node& after, Stamp stamp) {
  const double fraction = to_seconds(stamp - before.stamp) / to_seconds(after.stamp - before.stamp);
  return interpolate(before.T_source_base, after.T_source_base, fraction);
}

bool MotionTrack::has_sample_in(Stamp from, Stamp to) const {
  const std::size_t age = age_at(to + late_);
  return age < size_ && from_newest(age).stamp > from + late_;
}

bool MotionTrack::is_live(Stamp now) const {
  return size_ > 1 && now + late_ <= from_newest(0).stamp + kMaxExtrapolation &&
         from_newest(0).stamp <= from_newest(1).stamp + kMaxExtrapolation;
}

std::optional<Eigen::Vector3d> MotionTrack::up_base(Stamp from, Stamp to) const {
  if (!has_sample_in(from, to))
    return std::nullopt;
  from += late_;
  to += late_;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t age = age_at(to); age < size_ && from_newest(age).stamp > from; ++age) {
    if (!from_newest(age).up_base)
      return std::nullopt;
    sum += *from_newest(age).up_base;
  }
  return sum.normalized();
}

std::optional<SpecificForce> MotionTrack::specific_force(Stamp from, Stamp to) const {
  if (kind_ != SourceKind::imu || !has_sample_in(from, to))
    return std::nullopt;
  from += late_;
  to += late_;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), sum_by_time = Eigen::Vector3d::Zero(); // integrals
  Eigen::Vector3d end = force_at(to);
  double end_s = to_seconds(to - from);
  const double all_s = end_s;
  for (std::size_t age = age_at(to); end_s > 0.0; ++age) {
    const bool inside = age < size_ && from_newest(age).stamp > from;
    const Eigen::Vector3d begin = inside ? from_newest(age).specific_force_base_mps2 : force_at(from);
    const double begin_s = inside ? to_seconds(from_newest(age).stamp - from) : 0.0;
    sum += 0.5 * (end_s - begin_s) * (begin + end);
    sum_by_time += (end_s - begin_s) / 6.0 * (begin_s * (2.0 * begin + end) + end_s * (begin + 2.0 * end));
    end = begin;
    end_s = begin_s;
  }
  const Eigen::Vector3d late = 2.0 / (all_s * all_s) * sum_by_time;
  return SpecificForce{.early_base_mps2 = 2.0 / all_s * sum - late,
                       .late_base_mps2 = late,
                       .noise_per_s = force_noise_per_s(to),
                       .late = late_};
}

/// Interpolates between two samples; before the first and after the last, returns that sample.
Eigen::Vector3d MotionTrack::force_at(Stamp stamp) const {
  const std::size_t age = age_at(stamp);
  if (age == size_)
    return from_newest(size_ - 1).specific_force_base_mps2;
  const Node& before = from_newest(age);
  if (age == 0)
    return before.specific_force_base_mps2;
  const Node& after = from_newest(age - 1);
  const double fraction = to_seconds(stamp - before.stamp) / to_seconds(after.stamp - before.stamp);
  return before.specific_force_base_mps2 +
         fraction * (after.specific_force_base_mps2 - before.specific_force_base_mps2);
}

/// Estimates the noise from the second differences of recent samples, whose variance is six times that of the samples:
/// vibration, and what a slow unit misses between its samples. A steady change contributes nothing.
Eigen::Vector3d MotionTrack::force_noise_per_s(Stamp to) const {
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  const std::size_t newest = age_at(to);
  std::size_t age = newest;
  for (; age + 2 < size_ && from_newest(age + 2).stamp > to - kNoiseWindow; ++age)
    squares += (from_newest(age).specific_force_base_mps2 - 2.0 * from_newest(age + 1).specific_force_base_mps2 +
                from_newest(age + 2).specific_force_base_mps2)
                   .cwiseAbs2();
  const auto count = static_cast<double>(age - newest);
  if (count == 0.0)
    return Eigen::Vector3d::Zero();
  const double spacing_s = to_seconds(from_newest(newest).stamp - from_newest(age + 1).stamp) / (count + 1.0);
  return spacing_s / (6.0 * count) * squares;
}

} // namespace locus
