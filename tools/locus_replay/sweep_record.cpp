// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/sweep_record.hpp"

#include <cmath>
#include <cstddef>

namespace locus::tools {
namespace {

SourceHealth health_of_lidars(const daemon::ProcessedSweep& sweep) {
  if (sweep.raw_returns == 0)
    return SourceHealth::lost;
  return sweep.estimate.failed ? SourceHealth::healthy : SourceHealth::used;
}

} // namespace

SweepRecord record_of(const daemon::ProcessedSweep& sweep) {
  const OdometryEstimate& estimate = sweep.estimate;
  SweepRecord record{.stamp = estimate.stamp,
                     .T_odom_base = estimate.T_odom_base,
                     .std_m = std::sqrt(estimate.pose_covariance.topLeftCorner<3, 3>().trace()),
                     .speed_mps = estimate.twist_base.head<3>().norm(),
                     .wall_ms = 1e3 * to_seconds(sweep.took.wall),
                     .stages_took = sweep.stages_took,
                     .state = estimate.state,
                     .lidars = health_of_lidars(sweep)};
  for (std::size_t i = 0; i < record.sources.size(); ++i)
    record.sources[i] = sweep.usable_sources[i] ? SourceHealth::healthy : SourceHealth::lost;
  for (const std::optional<SourceId> used : {estimate.prior.rotation, estimate.prior.translation}) {
    if (used)
      record.sources[index_of(*used)] = SourceHealth::used;
  }
  return record;
}

} // namespace locus::tools
