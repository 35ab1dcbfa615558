// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "core/base/pose.hpp"

namespace locus {

/// PCL's point-to-point ICP between two clouds that already lie roughly on each other, pairs within `reach_m`. Returns
/// T_target_source; identity where they have nothing in common.
Pose icp(std::span<const Eigen::Vector3f> source, std::span<const Eigen::Vector3f> target, double reach_m);

} // namespace locus
