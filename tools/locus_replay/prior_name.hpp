// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/odometry/odometry_estimate.hpp"

namespace locus::tools {

/// Names the sources of rotation and translation, once if they are the same: "wio", "imu+wio", "identity".
inline std::string name_of(const PriorSource& prior, std::span<const std::string> source_names) {
  const auto name = [&](std::optional<SourceId> source) -> std::string {
    if (source)
      return source_names[index_of(*source)];
    return prior.otherwise == NoSourcePrior::constant_velocity ? "constant_velocity" : "identity";
  };
  return prior.rotation == prior.translation ? name(prior.rotation)
                                             : name(prior.rotation) + '+' + name(prior.translation);
}

} // namespace locus::tools
