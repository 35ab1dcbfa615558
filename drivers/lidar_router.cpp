// SPDX-License-Identifier: Apache-2.0
#include "drivers/lidar_router.hpp"

#include <algorithm>

namespace locus {

Expected<LidarRouter, std::string> LidarRouter::open(const std::vector<LidarOptions>& options) {
  std::vector<LidarInput> lidars;
  lidars.reserve(options.size());
  for (const LidarOptions& one : options) {
    auto lidar = LidarInput::open(one, static_cast<std::uint8_t>(lidars.size()));
    if (!lidar)
      return lidar.error();
    lidars.push_back(std::move(*lidar));
  }
  return LidarRouter{std::move(lidars)};
}

const LidarPacket* LidarRouter::receive(const Datagram& datagram) {
  if (LidarInput* lidar = find(datagram)) {
    latest_ = static_cast<std::size_t>(lidar - lidars_.data());
    return lidar->receive(datagram);
  }
  latest_.reset();
  ++foreign_.received;
  ++foreign_[PacketError::sender];
  return nullptr;
}

/// Finds the lidar with this address, else one on this port without an address, else one on this port (which rejects
/// the datagram).
LidarInput* LidarRouter::find(const Datagram& datagram) {
  LidarInput* found = nullptr;
  for (LidarInput& lidar : lidars_) {
    if (!lidar.listens_to(datagram.destination_port))
      continue;
    if (lidar.sender().ip() == datagram.source_ip)
      return &lidar;
    if (found == nullptr || (found->sender().ip() && !lidar.sender().ip()))
      found = &lidar;
  }
  return found;
}

LidarRouter::Origin LidarRouter::configured_for(const Datagram& datagram) const {
  const auto found = std::ranges::find_if(lidars_, [&](const LidarInput& lidar) {
    return lidar.listens_to(datagram.destination_port) &&
           lidar.options().source_ip.value_or(datagram.source_ip) == datagram.source_ip;
  });
  if (found == lidars_.end())
    return {};
  return {found->options().name,
          found->decoder().ouster() != nullptr ? &found->decoder().ouster()->metadata() : nullptr};
}

void LidarRouter::Senders::add_lengths(std::span<const std::size_t> more) {
  for (const std::size_t bytes : more)
    if (std::ranges::find(all_lengths(), bytes) == all_lengths().end() && length_count < kMaxLengths)
      lengths[length_count++] = bytes;
}

LidarRouter::Senders LidarRouter::senders_to(std::uint16_t port) const {
  Senders senders;
  std::size_t lidars = 0;
  for (const LidarInput& lidar : lidars_) {
    if (lidars == Senders::kMax || !lidar.listens_to(port))
      continue;
    if (lidars++ == 0)
      senders.length_count = 0;
    const PacketLengths lengths = lidar.decoder().lengths();
    senders.add_lengths(lengths.all());
    if (lidar.sender().ip())
      senders.ips[senders.count++] = *lidar.sender().ip();
  }
  if (senders.count < lidars)
    senders.count = 0;
  return senders;
}

PacketCounters LidarRouter::total() const {
  PacketCounters sum = foreign_;
  for (const LidarInput& lidar : lidars_)
    sum += lidar.counters();
  return sum;
}

} // namespace locus
