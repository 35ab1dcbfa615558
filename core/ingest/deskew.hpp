// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// The mean twist that the points of a sweep came corrected for; zero where they did not.
Vector6 corrected_twist(const Sweep& sweep);

/// Moves points of one sweep from where they came corrected to, to where they lay at its end. To be applied, it
/// comes from all() or anew(). Any thread.
class SweepCorrection {
 public:
  /// For a base that moved with `twist_base` (m/s, rad/s) on the mean, and as the points were corrected for beside it.
  static SweepCorrection all(const Sweep& sweep, const Vector6& twist_base);

  /// The same whatever motion the points were corrected for, which is taken out of them again: for a source that is not
  /// believed after all.
  static SweepCorrection anew(const Sweep& sweep, const Vector6& twist_base);

  /// Replaces `scan` by the points moved, in their order.
  void apply(std::span<const SweepPoint> points, std::vector<SurfacePoint>& scan) const;

 private:
  /// What turns the old correction into the new one; linear from one place of the path to the next.
  struct Place {
    float age_s;
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
  };

  void add(double age_s, const Pose& T_true_corrected);
  [[nodiscard]] Place at_age(float age_s) const;

  std::array<Place, CorrectedPath::kMaxPlaces> places_; ///< from the oldest on
  std::size_t count_ = 0;
};

} // namespace locus
