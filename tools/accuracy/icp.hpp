// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "core/base/pose.hpp"

namespace locus {

/// Registers two roughly aligned clouds with PCL's point-to-point ICP; pairs within `reach_m`. Returns T_target_source;
/// identity if the clouds do not overlap.
Pose icp(std::span<const Eigen::Vector3f> source, std::span<const Eigen::Vector3f> target, double reach_m);

} // namespace locus
