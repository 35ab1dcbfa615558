// SPDX-License-Identifier: Apache-2.0
#include "core/base/options.hpp"

#include "core/base/problems.hpp"

namespace locus {
namespace {

void check(Problems& problems, const std::string& section, const RegistrationOptions& options) {
  problems.require_range(section + ".max_iterations", options.max_iterations, 1, 100);
  problems.require_range(section + ".max_correspondence_m", options.max_correspondence_m, 0.01, 100.0);
}

} // namespace

std::optional<std::string> SweepOptions::problem() const {
  Problems problems;
  if (sweep_period)
    problems.require_range("sweep_period_ms", to_seconds(*sweep_period) * 1e3, 10.0, 1000.0);
  problems.require(min_range_m >= 0 && min_range_m < max_range_m && max_range_m <= 1000, "range_m",
                   "must be [nearest, farthest] with 0 <= nearest < farthest <= 1000");
  problems.require(!body_box.enabled || (body_box.min_m.array() < body_box.max_m.array()).all(), "body_box.max_m",
                   "each of its three numbers must be greater than that of min_m");
  if (segment_filter.points)
    problems.require_range<std::size_t>("segment_filter.points", *segment_filter.points, 100, 1'000'000);
  problems.require_range("voxel_filter.leaf_m", voxel_filter.leaf_m, 0.01, 10.0);
  problems.require_range("random_filter.keep", random_filter.keep, 0.001, 1.0);
  return problems.result();
}

std::optional<std::string> OdometryOptions::problem() const {
  Problems problems;
  problems.require_range("motion.max_speed_mps", motion.max_speed_mps, 0.1, 1000.0);
  problems.require_range("motion.max_acceleration_mps2", motion.max_acceleration_mps2, 0.1, 1000.0);
  check(problems, "scan_to_scan", scan_to_scan);
  check(problems, "scan_to_submap", scan_to_submap);
  problems.require_range("map.keyframe_m", map.keyframe_m, 0.01, 100.0);
  problems.require_range("map.keyframe_deg", map.keyframe_deg, 1.0, 180.0);
  problems.require_range<std::size_t>("map.max_bytes", map.max_bytes, 1'000'000, 100'000'000'000);
  problems.require_range("threads", threads, 1, 256);
  return problems.result();
}

} // namespace locus
