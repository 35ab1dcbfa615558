// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/stamp.hpp"
#include "locus_sim/shapes.hpp"

namespace locus::sim {

/// Pose of an object at one instant, world frame.
struct Place {
  Eigen::Vector3f ground_m; ///< where it stands
  float yaw_rad = 0;        ///< continuous, without wrapping
  float swing_rad = 0;      ///< of the left legs and arms, forward
};

/// Motion of an object, sampled every tenth of a second and interpolated linearly. Before the first sample it stands
/// there; after the last it stands or repeats. A step larger than any speed allows is a relocation. Immutable, any
/// thread.
class Track {
 public:
  static constexpr Duration kStep = std::chrono::milliseconds{100};
  /// Distance out of every sensor's range: an object here is absent.
  static constexpr float kAway_m = 1e7F;

  Track(std::vector<Place> places, bool closed);

  /// Returns the pose at a time since the first sample.
  [[nodiscard]] Place at(Duration since) const;
  /// Returns a sample within reach_m() of the pose.
  [[nodiscard]] const Place& near(Duration since) const { return places_[index(since / kStep)]; }
  [[nodiscard]] double reach_m() const { return reach_m_; }

 private:
  [[nodiscard]] std::size_t index(std::int64_t step) const;

  std::vector<Place> places_;
  bool closed_;
  double reach_m_ = 0; ///< longest step
};

/// Person or vehicle that follows a track. Immutable, any thread.
class Passer {
 public:
  enum class Kind : std::uint8_t { person, forklift, car, van };

  struct Met {
    double range_m;
    Eigen::Vector3d normal;
    std::uint8_t reflectivity;
  };

  /// Starts at the first sample of its track at `begin`. Tracks may be shared.
  Passer(Kind kind, std::shared_ptr<const Track> track, Stamp begin);

  /// Returns the part hit by a ray within a range, if any.
  [[nodiscard]] std::optional<Met> met_by(const Ray& ray, double max_range_m, Stamp stamp) const;
  [[nodiscard]] double distance_m(const Eigen::Vector3d& point, Stamp stamp) const;
  [[nodiscard]] Place at(Stamp stamp) const { return track_->at(stamp - begin_); }
  [[nodiscard]] Kind kind() const { return kind_; }

 private:
  [[nodiscard]] bool may_be_met_by(const Ray& ray, double max_range_m, Stamp stamp) const;
  [[nodiscard]] std::vector<Surface> parts(const Place& place) const;

  Kind kind_;
  std::shared_ptr<const Track> track_;
  Stamp begin_;
  std::vector<Surface> parts_; ///< for objects without limbs
  double radius_m_;            ///< of the enclosing circle on the ground, at any interpolated pose
};

} // namespace locus::sim
