// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/lidar_options.hpp"
#include "drivers/net/datagram.hpp"
#include "kitti/kitti_drive.hpp"
#include "kitti/kitti_sweep.hpp"

namespace locus::tools {

/// Sweeps of a drive as predecoded packets of one lidar, each received when it was fired. One sweep is in memory at a
/// time. One owner.
class KittiPackets : public DatagramSource {
 public:
  /// Raises the vertical angles of the points by `raised_deg`.
  KittiPackets(std::vector<KittiDrive::Sweep> sweeps, const LidarOptions& lidar, double raised_deg);

  const Datagram* next() override;
  [[nodiscard]] std::uint64_t datagrams() const override { return datagrams_; }
  [[nodiscard]] std::string why_none() const override;
  [[nodiscard]] std::vector<std::string> warnings() const override;
  [[nodiscard]] double progress() const override;

 private:
  void read(const KittiDrive::Sweep& sweep);

  std::vector<KittiDrive::Sweep> sweeps_;
  double raised_deg_;
  std::size_t next_sweep_ = 0;
  std::vector<KittiPoint> points_;
  KittiSweep sweep_;
  Datagram datagram_;
  std::uint64_t datagrams_ = 0;
  std::uint64_t damaged_ = 0, unordered_ = 0; ///< numbers of sweeps
};

} // namespace locus::tools
