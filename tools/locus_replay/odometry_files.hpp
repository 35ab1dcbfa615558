// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "core/odometry/odometry_estimate.hpp"
#include "locus_replay/output_file.hpp"

namespace locus::tools {

/// Writes odometry.tum and odometry.csv, a row each for every estimate. Numbers have enough digits to restore the same
/// bits. Throws Failure.
class OdometryFiles {
 public:
  OdometryFiles(const std::filesystem::path& folder, const std::vector<MotionSource>& sources);

  void write(const OdometryEstimate& estimate);
  void close();

 private:
  std::vector<std::string> source_names_;
  OutputFile tum_;
  OutputFile csv_;
};

} // namespace locus::tools
