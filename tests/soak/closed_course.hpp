// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "core/base/stamp.hpp"

namespace locus::soak {

/// A recorded drive with equal start and end state, so that it can be repeated seamlessly.
struct ClosedCourse {
  std::filesystem::path folder; ///< a capture folder
  Duration lap;                 ///< whole turns of the lidar, whole packets, whole microseconds of its clock
};

/// Simulates, unless `folder` already contains it, a lap of about the requested duration: the husky of locus-sim with
/// all its sensors drives about the plant, turns around, drives back the same way and stands for the last tenth of the
/// lap. Effects that would differ between end and start are disabled: the ripples of the floor, which depend on the
/// distance travelled, and the slow drift of the IMU's bias and attitude. People and forklift jump at the start of a
/// lap.
ClosedCourse closed_course(const std::filesystem::path& folder, Duration about);

} // namespace locus::soak
