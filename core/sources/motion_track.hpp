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

/// Recent motion of the base as measured by one source, available for any instant.
///
/// Poses are in the source's own odometry frame, so only their differences are meaningful. An inertial source
/// integrates its gyro: its poses rotate but do not translate. Poses are interpolated between samples and extrapolated
/// beyond the newest one with the last velocity, for kMaxExtrapolation at most. The velocity of an odometry is computed
/// from two samples that are kShortestBaseline apart: between closer ones a small error of a stamp would dominate it.
/// Memory is fixed at construction. One owner.
class MotionTrack {
 public:
  static constexpr std::size_t kCapacity = 2048;                               ///< two seconds at 1 kHz
  static constexpr Duration kMaxExtrapolation = std::chrono::milliseconds{50}; ///< beyond the newest sample (contract)
  static constexpr Duration kShortestBaseline = std::chrono::milliseconds{15}; ///< for 50 Hz sources with jitter

  explicit MotionTrack(const MotionSourceOptions& options);

  /// Add the next sample, which must be finite and newer than the last; HealthMonitor ensures it.
  void add(const ImuSample& sample);
  void add(const OdometrySample& sample);

  /// Sets the delay of the stamps after the motion. Queries are shifted by it.
  void set_late(Duration late) { late_ = late; }
  /// Returns the part of a stamp delay that is worth removing. With more, a sample arrives later than can well be
  /// extrapolated when points are corrected.
  [[nodiscard]] static Duration applied_lateness(double late_s);
  [[nodiscard]] Duration late() const { return late_; }

  /// Drops all samples, when the following ones are not continuous with them.
  void clear() { size_ = 0; }

  /// Returns T_source_base at `stamp`; nothing before the oldest sample and later than kMaxExtrapolation after the
  /// newest.
  [[nodiscard]] std::optional<Pose> at(Stamp stamp) const;

  /// Returns whether a sample lies in (from, to]. A source without one is not used for that sweep.
  [[nodiscard]] bool has_sample_in(Stamp from, Stamp to) const;

  /// Returns the instant of the newest sample; nothing if there is none.
  [[nodiscard]] std::optional<Stamp> newest() const {
    return size_ > 0 ? std::optional{from_newest(0).stamp - late_} : std::nullopt;
  }

  /// Returns whether the newest sample is at most kMaxExtrapolation old, and came at most that long after the one
  /// before.
  [[nodiscard]] bool is_live(Stamp now) const;

  /// Returns the mean over exactly (from, to], linear between samples; nothing for odometry or without a sample in it.
  [[nodiscard]] std::optional<SpecificForce> specific_force(Stamp from, Stamp to) const;

  /// Returns the up direction in the base frame, a unit vector, from the mean attitude of the samples in (from, to];
  /// nothing if one of them has no attitude.
  [[nodiscard]] std::optional<Eigen::Vector3d> up_base(Stamp from, Stamp to) const;

  [[nodiscard]] SourceKind kind() const { return kind_; }

 private:
  struct Node {
    Stamp stamp;
    Pose T_source_base;
    Eigen::Vector3d specific_force_base_mps2 = Eigen::Vector3d::Zero();
    std::optional<Eigen::Vector3d> up_base;
  };

  static constexpr Duration kNoiseWindow = std::chrono::milliseconds{300}; ///< for measuring the noise of the forces

  [[nodiscard]] Eigen::Vector3d force_at(Stamp stamp) const;
  [[nodiscard]] Eigen::Vector3d force_noise_per_s(Stamp to) const;
  [[nodiscard]] Pose extrapolated(Stamp stamp) const;
  [[nodiscard]] static Pose between(const Node& before, const Node& after, Stamp stamp);
  void push(const Node& node);
  [[nodiscard]] const Node& from_newest(std::size_t age) const;
  /// Returns the age (0: newest) of the newest node that is not later than `stamp`; size_ if all are later.
  [[nodiscard]] std::size_t age_at(Stamp stamp) const;

  SourceKind kind_;
  Duration late_{};
  Pose T_base_source_;
  Eigen::Vector3d last_angular_velocity_base_radps_ = Eigen::Vector3d::Zero();
  std::vector<Node> nodes_; ///< ring buffer
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

} // namespace locus
