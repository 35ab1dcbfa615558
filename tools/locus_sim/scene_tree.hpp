// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "locus_sim/shapes.hpp"

namespace locus::sim {

inline constexpr std::uint32_t kSurface = 0x8000'0000; ///< flag of a surface index, as opposed to a node index

/// Node of a bounding volume hierarchy over surfaces, world frame. Four children, one per lane. Candidates are found in
/// single precision; hits are computed in double precision.
struct TreeNode {
  using Lanes = Eigen::Array4f;
  std::array<Lanes, 3> min_m, max_m;  ///< of x, y and z
  std::array<std::uint32_t, 4> child; ///< node, or surface with kSurface set
};

/// Sorts surfaces into a hierarchy. Returns its nodes, root last; none without a surface. Any thread.
std::vector<TreeNode> make_tree(std::vector<Surface>& surfaces);

/// Returns the union of the bounds of all surfaces; without a surface, bounds beyond any ray. Any thread.
Bounds bounds_of(std::span<const Surface> surfaces);

} // namespace locus::sim
