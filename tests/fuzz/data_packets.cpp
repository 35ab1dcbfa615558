// SPDX-License-Identifier: Apache-2.0
// Datagrams to one lidar, of any model and with any time source.
#include <chrono>
#include <cmath>
#include <numeric>
#include <vector>

#include "drivers/lidar_input.hpp"
#include "fuzz/packet_stream.hpp"

namespace locus {
namespace {

using fuzz::demand;

std::vector<LidarInput> all_kinds() {
  std::vector<LidarInput> lidars;
  for (const LidarTime time : {LidarTime::automatic, LidarTime::sensor, LidarTime::receive}) {
    LidarOptions options;
    options.time = time;
    lidars.push_back(*LidarInput::open(options, 0));
    for (const velodyne::Model model : velodyne::kModels) {
      options.model = model;
      lidars.push_back(*LidarInput::open(options, 0));
    }
  }
  return lidars;
}

void check(const LidarPacket& packet) {
  constexpr Duration kLongest = std::chrono::seconds{1};
  demand(packet.count > 0 && packet.count <= LidarPacket::kMaxFiringGroups);
  demand(packet.first_azimuth_cdeg < velodyne::kCdegPerTurn);
  demand(packet.duration > Duration{} && packet.duration < kLongest);
  for (const FiringGroup& group : packet.firing_groups()) {
    demand(group.first_laser + FiringGroup::kLasers <= velodyne::kMaxLasers);
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
      demand(std::isfinite(group.x_m[k] + group.y_m[k] + group.z_m[k]) && group.range_m[k] >= 0.0F);
      demand(group.ring[k] < velodyne::kMaxLasers && std::abs(group.offset_ns[k]) < kLongest.count());
    }
  }
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  static const std::vector<LidarInput> kKinds = all_kinds();
  fuzz::FuzzBytes bytes{data, size};
  LidarInput lidar = kKinds[bytes.take<std::uint8_t>() % kKinds.size()];
  constexpr int kLongestStream = 16;
  fuzz::PacketStream packets;
  for (int datagrams = 0; datagrams < kLongestStream && !bytes.empty(); ++datagrams) {
    if (const LidarPacket* const packet = lidar.receive(packets.next(bytes)))
      check(*packet);
  }
  const PacketCounters& counters = lidar.counters();
  demand(counters.received ==
         std::accumulate(counters.rejected.begin(), counters.rejected.end(), counters.data + counters.position));
  return 0;
}
