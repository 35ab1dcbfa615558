// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <fmt/format.h>

#include "liblocus.hpp"

namespace locus::test {

/// Formats the estimate as a row of odometry.csv and of odometry.tum. Independent of the program's code, so that every
/// number of the library is compared with the program's files.
inline std::string csv_row(const liblocus::Estimate& estimate) {
  std::string row = fmt::format("{},{},{},{},{}", estimate.stamp_ns, name_of(estimate.state), estimate.prior,
                                estimate.iterations, estimate.inliers);
  for (const double value : estimate.pose_covariance)
    row += fmt::format(",{}", value);
  for (const liblocus::SourceEstimate& source : estimate.sources) {
    for (const double value : source.innovation)
      row += fmt::format(",{}", value);
    for (const double value : source.innovation_sigma)
      row += fmt::format(",{}", value);
    row += fmt::format(",{},{}", source.test_ratio, source.last_used_ns);
  }
  return row;
}

inline std::string tum_row(const liblocus::Estimate& estimate) {
  constexpr std::int64_t kPerSecond = 1'000'000'000;
  std::string row = fmt::format("{}.{:09}", estimate.stamp_ns / kPerSecond, estimate.stamp_ns % kPerSecond);
  for (const double value : estimate.position_m)
    row += fmt::format(" {}", value);
  for (const double value : estimate.orientation_xyzw)
    row += fmt::format(" {}", value);
  return row;
}

} // namespace locus::test
