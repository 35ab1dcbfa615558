// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/ingest/sweep.hpp"

namespace locus::experiments {

/// Reduces an uncut sweep to LOAM's edge and plane points (Zhang and Singh, LOAM, RSS 2014, section V-A).
///
/// The curvature c of a return against its ten neighbours along the scan line distinguishes edges from planes. Each
/// quarter of a line gives a limited number of each, those of largest and of least c; none adjacent to another, none on
/// a surface nearly along the beam, none at the edge of an occlusion. The numbers are those of LOAM's mapping, ten
/// times those of its odometry. Ranges are measured from the base, which is close enough to a lidar for this. Expects
/// every return in the sweep, all filters off.
void keep_loam_features(Sweep& sweep);

} // namespace locus::experiments
