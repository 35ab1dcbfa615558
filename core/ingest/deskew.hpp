// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// The mean twist that the points of a sweep came corrected for; zero where they did not.
Vector6 corrected_twist(const Sweep& sweep);

/// Writes to `scan` where the points of a sweep lay at its end, for a base that moved with `twist_base` (m/s, rad/s) on
/// the mean, and as they were corrected for beside it. Any thread.
void correct_all(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan);

/// The same whatever motion the points were corrected for, which is taken out of them again: for a source that is not
/// believed after all.
void correct_anew(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan);

} // namespace locus
