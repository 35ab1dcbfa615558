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

/// Where something is at one instant, world frame.
struct Place {
  Eigen::Vector3f ground_m; ///< that it stands on
  float yaw_rad = 0;        ///< without jumps of a turn
  float swing_rad = 0;      ///< of legs and arms: of those on the left, forward
};

/// Where something is, tenth by tenth of a second, straight on in between. Before the first it stands there, after the
/// last one too, or it begins anew. What is farther from one step to the next than anything drives has been taken away
/// and put elsewhere. Immutable, any thread.
class Track {
 public:
  static constexpr Duration kStep = std::chrono::milliseconds{100};
  /// Where nobody ever looks: what stands here is not there.
  static constexpr float kAway_m = 1e7F;

  Track(std::vector<Place> places, bool closed);

  /// Since its first place.
  [[nodiscard]] Place at(Duration since) const;
  /// Not farther than reach_m() from it.
  [[nodiscard]] const Place& near(Duration since) const { return places_[index(since / kStep)]; }
  [[nodiscard]] double reach_m() const { return reach_m_; }

 private:
  [[nodiscard]] std::size_t index(std::int64_t step) const;

  std::vector<Place> places_;
  bool closed_;
  double reach_m_ = 0; ///< the longest step
};

/// People and vehicles that go where their track says. Immutable, any thread.
class Passer {
 public:
  enum class Kind : std::uint8_t { person, forklift, car, van };

  struct Met {
    double range_m;
    Eigen::Vector3d normal;
    std::uint8_t reflectivity;
  };

  /// At `begin` it is at the first place of its track, which others may share.
  Passer(Kind kind, std::shared_ptr<const Track> track, Stamp begin);

  /// What a ray meets of it within a range, if anything.
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
  std::vector<Surface> parts_; ///< of what has no limbs
  double radius_m_;            ///< of the circle on the ground that holds it, wherever it is between two places
};

} // namespace locus::sim
