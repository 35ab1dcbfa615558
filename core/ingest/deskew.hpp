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

/// Returns the mean twist (m/s, rad/s), over the whole sweep, of the motion that its points were corrected for; zero if
/// they were not. Packets may cover a part of the sweep only.
Vector6 corrected_twist(const Sweep& sweep);

/// Second de-skew of one sweep: moves its points from their positions as received to their positions at the end of the
/// sweep. Created by all() or constant(). Any thread.
class SweepCorrection {
 public:
  /// De-skews for a base with mean twist `twist_base` (m/s, rad/s); variations in the earlier correction are retained.
  static SweepCorrection all(const Sweep& sweep, const Vector6& twist_base);

  /// De-skews for a constant `twist_base` and undoes the earlier correction: for a source that turned out to be wrong.
  static SweepCorrection constant(const Sweep& sweep, const Vector6& twist_base);

  /// Replaces `scan` by the moved points, in the same order.
  void apply(std::span<const SweepPoint> points, std::vector<SurfacePoint>& scan) const;

 private:
  /// Transform from the earlier correction to the new one; linear in age between two places.
  struct Place {
    float age_s;
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
  };

  void add(double age_s, const Pose& T_true_corrected);
  [[nodiscard]] Place at_age(float age_s) const;

  std::array<Place, CorrectedPath::kMaxPlaces> places_; ///< oldest first
  std::size_t count_ = 0;
};

} // namespace locus
