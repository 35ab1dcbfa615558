// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/clouds/cloud_view.hpp"
#include "drivers/net/datagram.hpp"
#include "sweep_folder/sweep_folder.hpp"

namespace locus::tools {

/// Sweeps of a folder as clouds of the first lidar, each received when the next one begins. One sweep is in memory at a
/// time. One owner.
class SweepClouds : public DatagramSource {
 public:
  /// Raises the vertical angles of the points of KITTI's lidar by `raised_deg`.
  SweepClouds(SweepFolder folder, double raised_deg);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return datagrams_; }
  [[nodiscard]] std::string why_none() const override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  SweepFolder folder_;
  double raised_deg_;
  std::size_t next_sweep_ = 0;
  SweepPoints points_;
  CloudView cloud_;
  Datagram datagram_;
  std::uint64_t datagrams_ = 0, damaged_ = 0;
  std::string first_problem_; ///< first problem with a sweep, with its name
};

} // namespace locus::tools
