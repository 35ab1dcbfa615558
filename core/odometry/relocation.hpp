// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "core/base/options.hpp"
#include "core/map/registration.hpp"
#include "core/map/surface_map.hpp"

namespace locus {

/// Where a sweep lies in a map that another run has left behind: within half a metre of where it is expected, or
/// nowhere.
///
/// How much of a sweep finds a correspondence is a matter of the place: nine tenths in a tunnel, half where much is far
/// or hidden. So it is compared with what it finds two metres away on every side. The less of the place is known, the
/// clearer it must fit better than those around; one of which most is known may be a corridor, which looks the same two
/// metres on, and need only fit hardly less. Any thread, one at a time for a Gicp.
std::optional<Pose> relocate(Gicp& gicp, std::span<const SurfacePoint> scan_base, const SurfaceMap& map,
                             const Pose& T_map_expected, const RegistrationOptions& options);

} // namespace locus
