// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/base/surface_point.hpp"
#include "core/ingest/sweep.hpp"
#include "daemon/dds/ros_messages.hpp"

namespace locus::daemon {

/// Replaces `out` by the de-skewed points of a sweep, in the base frame at its end; `deskewed` has the order of
/// `points`.
void sweep_points(std::span<const SweepPoint> points, std::span<const SurfacePoint> deskewed,
                  std::vector<CloudMessage::Point>& out);

} // namespace locus::daemon
