// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/ingest/sweep.hpp"

namespace locus::experiments {

/// Leaves of an uncut sweep LOAM's edge and plane points (Zhang and Singh, LOAM, RSS 2014, section V-A).
///
/// Along each scan line the curvature c of a return against its ten neighbours tells edges from planes. Each quarter of
/// a line gives at most so many of each, those of largest and of least c; none beside another, none on a surface nearly
/// along the beam, none at the border of what something nearer hides. The numbers are those of LOAM's mapping, ten
/// times those of its odometry. Ranges are reckoned from the base, which is close enough to a lidar for them. Expects
/// every return in the sweep, all filters off.
void keep_loam_features(Sweep& sweep);

} // namespace locus::experiments
