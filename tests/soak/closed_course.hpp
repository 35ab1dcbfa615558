// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "core/base/stamp.hpp"

namespace locus::soak {

/// A recorded drive that ends where and as it began, so that it can be driven round and round.
struct ClosedCourse {
  std::filesystem::path folder; ///< a capture folder
  Duration lap;                 ///< whole turns of the lidar, whole packets, whole microseconds of its clock
};

/// The husky of locus-sim with all its sensors drives about the plant, turns about, drives back the same way and stands
/// for the last tenth of the lap. What would not be at the end as it was at the beginning is left out: the ripples of
/// the floor, which follow the way behind, and the slow wander of the IMU's bias and attitude. People and forklift
/// jump as a lap begins.
///
/// Simulates it if `folder` does not hold it yet; a lap is `about` as long as asked.
ClosedCourse closed_course(const std::filesystem::path& folder, Duration about);

} // namespace locus::soak
