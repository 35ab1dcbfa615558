// SPDX-License-Identifier: Apache-2.0
// Clouds of one lidar, from a bag or DDS. The first byte selects type, serialisation and time field; each cloud is the
// length of its message, then the message, and arrives a while after the previous one.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numeric>
#include <string_view>
#include <vector>

#include "drivers/clouds/cloud_decoder.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus {
namespace {

using fuzz::demand;

void check(const LidarPacket& packet) {
  constexpr Duration kLongest = std::chrono::seconds{1};
  demand(packet.count <= LidarPacket::kMaxFiringGroups && packet.cloud.has_value());
  demand(packet.first_azimuth_cdeg < 36000);
  demand(packet.duration > Duration{} && packet.duration < kLongest);
  demand(packet.stamp >= packet.cloud->begin && packet.stamp + packet.duration <= packet.cloud->end);
  for (const FiringGroup& group : packet.firing_groups()) {
    demand(group.first_laser + FiringGroup::kLasers <= LidarPacket::kMaxLasers);
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k) {
      demand(std::isfinite(group.x_m[k] + group.y_m[k] + group.z_m[k]) && group.range_m[k] >= 0.0F);
      demand(group.ring[k] < LidarPacket::kMaxLasers && group.offset_ns[k] < packet.duration.count());
    }
  }
}

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  constexpr int kMostClouds = 8;
  fuzz::FuzzBytes bytes{data, size};
  const auto kind = bytes.take<std::uint8_t>();
  const auto serialisation = kind % 2 == 0 ? Serialisation::ros1 : Serialisation::cdr;
  const std::string_view type = kind / 2 % 2 == 0 ? kPointCloudType : "livox_ros_driver2/CustomMsg";
  static const std::array kPristine{CloudDecoder{0, PointTimesFrom::automatic},
                                    CloudDecoder{0, PointTimesFrom::azimuth}, CloudDecoder{0, PointTimesFrom::none}};
  static CloudDecoder decoder{0}; // static: allocating its memory would dominate the run time
  decoder = kPristine[kind / 4 % 3];
  Stamp arrival = stamp_from_ns(1'700'000'000'000'000'000);
  std::uint64_t returns = 0;
  for (int clouds = 0; clouds < kMostClouds && !bytes.empty(); ++clouds) {
    arrival += std::chrono::milliseconds{bytes.take<std::uint8_t>()};
    std::vector<std::byte> message(bytes.take<std::uint16_t>() % (bytes.rest().size() + 1));
    bytes.fill(message);
    const auto cloud = read_cloud({message, serialisation}, type);
    if (!cloud)
      decoder.refuse(CloudError::cut);
    if (!cloud || decoder.begin(*cloud, arrival))
      continue;
    while (const LidarPacket* packet = decoder.next()) {
      check(*packet);
      for (const FiringGroup& group : packet->firing_groups())
        returns += static_cast<std::uint64_t>(std::ranges::count_if(group.range_m, [](float m) { return m > 0.0F; }));
    }
  }
  const CloudCounters& counters = decoder.counters();
  demand(counters.received == std::accumulate(counters.refused.begin(), counters.refused.end(), counters.used));
  demand(returns + counters.nan + counters.origin + counters.untimed <= counters.points);
  return 0;
}
