// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/options.hpp"
#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"
#include "core/sources/motion_sample.hpp"

namespace locus {

/// The recent motion of the base as one source saw it, asked for at any instant.
///
/// Poses are in the source's own odometry frame, so only their differences mean anything. An inertial source integrates
/// its gyro: its poses turn but do not move. Between samples poses are interpolated; beyond the newest they are
/// extrapolated with the last velocity, for kMaxExtrapolation at most. The velocity of an odometry is told by two
/// samples that lie kShortestBaseline apart: of closer ones a stamp that is off by a moment would make any. Memory is
/// fixed at construction. One owner.
class MotionTrack {
 public:
  static constexpr std::size_t kCapacity = 2048;                               ///< two seconds at 1 kHz
  static constexpr Duration kMaxExtrapolation = std::chrono::milliseconds{50}; ///< beyond the newest sample (contract)
  static constexpr Duration kShortestBaseline = std::chrono::milliseconds{15}; ///< sources of 50 Hz jitter, too

  explicit MotionTrack(const MotionSourceOptions& options);

  /// Takes the next sample: finite and newer than the last, as HealthMonitor lets them pass.
  void add(const ImuSample& sample);
  void add(const OdometrySample& sample);

  /// Samples are stamped so much later than the motion that they tell of: what is asked for is told as of then.
  void set_late(Duration late) { late_ = late; }
  /// The part of a lateness that is worth it. What is told later than it may well be extrapolated is not there yet when
  /// a point is corrected.
  [[nodiscard]] static Duration taken_out(double late_s);
  [[nodiscard]] Duration late() const { return late_; }

  /// Forgets all samples: what comes next does not follow from them.
  void clear() { size_ = 0; }

  /// T_source_base at `stamp`; nothing before the oldest sample and later than kMaxExtrapolation after the newest.
  [[nodiscard]] std::optional<Pose> at(Stamp stamp) const;

  /// Whether a sample lies in (from, to]. A source without one is not used for that sweep.
  [[nodiscard]] bool has_sample_in(Stamp from, Stamp to) const;

  /// Of the newest sample; nothing while there is none.
  [[nodiscard]] std::optional<Stamp> newest() const {
    return size_ > 0 ? std::optional{from_newest(0).stamp - late_} : std::nullopt;
  }

  /// Whether the newest sample is at most kMaxExtrapolation old, and came as soon after the one before.
  [[nodiscard]] bool is_live(Stamp now) const;

  /// Over exactly (from, to], on the line between the samples; nothing for odometry or without a sample in there.
  [[nodiscard]] std::optional<SpecificForce> specific_force(Stamp from, Stamp to) const;

  /// Unit vector in the base frame, from the mean attitude of the samples in (from, to]; nothing where one has none.
  [[nodiscard]] std::optional<Eigen::Vector3d> up_base(Stamp from, Stamp to) const;

  [[nodiscard]] SourceKind kind() const { return kind_; }

 private:
  struct Node {
    Stamp stamp;
    Pose T_source_base;
    Eigen::Vector3d specific_force_base_mps2 = Eigen::Vector3d::Zero();
    std::optional<Eigen::Vector3d> up_base;
  };

  static constexpr Duration kNoiseWindow = std::chrono::milliseconds{300}; ///< of forces, whose noise is measured

  [[nodiscard]] Eigen::Vector3d force_at(Stamp stamp) const;
  [[nodiscard]] Eigen::Vector3d force_noise_per_s(Stamp to) const;
  [[nodiscard]] Pose extrapolated(Stamp stamp) const;
  [[nodiscard]] static Pose between(const Node& before, const Node& after, Stamp stamp);
  void push(const Node& node);
  [[nodiscard]] const Node& from_newest(std::size_t age) const;
  /// Age of the newest node that is not later than `stamp`; size_ when all are.
  [[nodiscard]] std::size_t age_at(Stamp stamp) const;

  SourceKind kind_;
  Duration late_{};
  Pose T_base_source_;
  Eigen::Vector3d last_angular_velocity_base_radps_ = Eigen::Vector3d::Zero();
  std::vector<Node> nodes_; ///< ring
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

} // namespace locus
