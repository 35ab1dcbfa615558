// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/base/isa.hpp"
#include "core/base/pose.hpp"
#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"

namespace locus {

/// Writes to `scan` where the points of a sweep lay at its end, for a base that moved with a constant twist (m/s,
/// rad/s) while the sweep came in: the part of motion correction that no motion source could do. Any thread.
void correct_all(std::span<const SweepPoint> points, const Vector6& twist_base, Isa isa,
                 std::vector<SurfacePoint>& scan);

/// The same whatever motion the points were corrected for, which is taken out of them again: for a source that is not
/// believed after all.
void correct_anew(const Sweep& sweep, const Vector6& twist_base, std::vector<SurfacePoint>& scan);

} // namespace locus
