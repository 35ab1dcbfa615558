// SPDX-License-Identifier: Apache-2.0
#include "locus_replay/kitti_packets.hpp"

#include <utility>

#include <fmt/format.h>

namespace locus::tools {

KittiPackets::KittiPackets(std::vector<KittiDrive::Sweep> sweeps, const LidarOptions& lidar, double raised_deg)
    : sweeps_(std::move(sweeps)), raised_deg_(raised_deg) {
  datagram_.source_ip = lidar.source_ip.value_or(0);
  datagram_.source_port = datagram_.destination_port = lidar.port;
}

const Datagram* KittiPackets::next() {
  const LidarPacket* packet = sweep_.next();
  while (packet == nullptr && next_sweep_ < sweeps_.size()) {
    read(sweeps_[next_sweep_++]);
    packet = sweep_.next();
  }
  if (packet == nullptr)
    return nullptr;
  datagram_.decoded = packet;
  datagram_.receive_stamp = packet->stamp + packet->duration;
  ++datagrams_;
  return &datagram_;
}

void KittiPackets::read(const KittiDrive::Sweep& sweep) {
  if (!read_kitti_points(sweep.file, points_)) {
    ++damaged_;
    return;
  }
  raise(points_, raised_deg_);
  if (!sweep_.begin(points_, sweep.start, sweep.end))
    ++unordered_;
}

std::string KittiPackets::why_none() const {
  return fmt::format(
      "none of its {} sweeps can be used ({} damaged, {} not in the order of the lidar's lines); copy the "
      "drive again, as KITTI publishes it",
      sweeps_.size(), damaged_, unordered_);
}

std::vector<std::string> KittiPackets::warnings() const {
  if (damaged_ + unordered_ == 0)
    return {};
  return {fmt::format(
      "{}: {} sweeps are truncated or not points, {} not in the order of the lidar's lines; they are skipped",
      sweeps_.front().file.parent_path().string(), damaged_, unordered_)};
}

double KittiPackets::progress() const { return static_cast<double>(next_sweep_) / static_cast<double>(sweeps_.size()); }

} // namespace locus::tools
