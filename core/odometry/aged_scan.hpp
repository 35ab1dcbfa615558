// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"
#include "core/map/registration.hpp"

namespace locus {

/// Registered points of a sweep sorted by age, as input to the elastic registration: those of a block are of similar
/// age. Reuses its memory. One owner.
class AgedScan {
 public:
  /// Sorts `scan_base`: the points of the sweep, in its order, de-skewed for `twist_base` (m/s, rad/s) to its end. The
  /// result refers to this object.
  ElasticScan sort(const Sweep& sweep, std::span<const SurfacePoint> scan_base, const Vector6& twist_base);

 private:
  std::vector<SurfacePoint> points_base_;
  std::vector<float> age_s_;
};

} // namespace locus
