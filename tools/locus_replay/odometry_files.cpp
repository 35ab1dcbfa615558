// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/odometry_files.hpp"

#include <array>
#include <cstdint>
#include <string_view>

#include <fmt/format.h>

#include "drivers/files/motion_files.hpp"
#include "locus_replay/prior_name.hpp"

namespace locus::tools {
namespace {

std::string csv_header(const std::vector<std::string>& sources) {
  constexpr std::array<std::string_view, 6> kAxes{"x", "y", "z", "roll", "pitch", "yaw"};
  std::string header = "t_ns,state,source,iterations,inliers";
  for (const std::string_view row : kAxes) {
    for (const std::string_view column : kAxes)
      header += fmt::format(",cov_{}_{}", row, column);
  }
  for (const std::string& source : sources) {
    for (const std::string_view figure : {"innovation", "sd"})
      for (const std::string_view axis : kAxes)
        header += fmt::format(",{}_{}_{}", source, figure, axis);
    header += fmt::format(",{0}_test_ratio,{0}_last_used_ns", source);
  }
  return header;
}

} // namespace

OdometryFiles::OdometryFiles(const std::filesystem::path& folder, const std::vector<MotionSource>& sources)
    : tum_(folder / "odometry.tum"), csv_(folder / "odometry.csv") {
  for (const MotionSourceOptions& source : sources)
    source_names_.push_back(source.name);
  csv_.print("{}\n", csv_header(source_names_));
}

void OdometryFiles::write(const OdometryEstimate& estimate) {
  const std::int64_t ns = to_ns(estimate.stamp);
  tum_.print("{}", to_line({estimate.stamp, estimate.T_odom_base}));
  csv_.print("{},{},{},{},{}", ns, to_string(estimate.state), name_of(estimate.prior, source_names_),
             estimate.scan_to_submap.iterations, estimate.scan_to_submap.inliers);
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      csv_.print(",{}", estimate.pose_covariance(row, column));
  }
  for (std::size_t i = 0; i < source_names_.size(); ++i) {
    const SourceReport& report = estimate.sources[i];
    for (const double value : report.innovation.value)
      csv_.print(",{}", value);
    for (const double variance : report.innovation.variance)
      csv_.print(",{}", std::sqrt(variance));
    csv_.print(",{},{}", report.test_ratio, to_ns(report.last_used));
  }
  csv_.print("\n");
}

void OdometryFiles::close() {
  tum_.close();
  csv_.close();
}

} // namespace locus::tools
