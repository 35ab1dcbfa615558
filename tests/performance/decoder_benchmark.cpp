// SPDX-License-Identifier: Apache-2.0
// What a return costs to decode, beside copying its bytes.
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne_test_packet.hpp"
#include "suite.hpp"

namespace locus::performance {

namespace {

/// A packet of a full scene, three quarters of the firings with a return.
test::VelodyneTestPacket full_packet(velodyne::Model model, velodyne::ReturnMode mode) {
  test::VelodyneTestPacket bytes{model, mode, 1'000'000, 100};
  std::uint32_t random = 1;
  for (std::size_t block = 0; block < velodyne::kBlocks; ++block) {
    for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
      random = random * 1'664'525U + 1'013'904'223U;
      bytes.set_return(block, channel, static_cast<std::uint16_t>(random >> 30 == 0 ? 0 : random >> 16));
    }
  }
  return bytes;
}

std::size_t returns_of(const LidarPacket& packet) {
  std::size_t returns = 0;
  for (const FiringGroup& group : packet.firing_groups())
    for (const float range_m : group.range_m)
      returns += range_m > 0.0F ? 1 : 0;
  return returns;
}

/// Seconds per return as a counter, and how many such lidars one core decodes.
void report(benchmark::State& state, std::size_t returns, Duration packet_duration) {
  state.counters["s_per_return"] = benchmark::Counter(
      static_cast<double>(returns), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["lidars_per_core"] =
      benchmark::Counter(to_seconds(packet_duration), benchmark::Counter::kIsIterationInvariantRate);
}

void decode(benchmark::State& state, velodyne::Model model, velodyne::ReturnMode mode) {
  const test::VelodyneTestPacket bytes = full_packet(model, mode);
  velodyne::Decoder decoder{{.model = model}};
  LidarPacket packet;
  for (auto _ : state) {
    decoder.decode(bytes.payload(), packet);
    benchmark::DoNotOptimize(packet.count);
    benchmark::ClobberMemory();
  }
  report(state, returns_of(packet), velodyne::packet_duration(model, mode));
}

void copy(benchmark::State& state, velodyne::Model model, velodyne::ReturnMode mode) {
  const test::VelodyneTestPacket bytes = full_packet(model, mode);
  velodyne::Decoder decoder{{.model = model}};
  LidarPacket packet;
  decoder.decode(bytes.payload(), packet);
  std::array<std::byte, velodyne::kDataPacketBytes> copied;
  for (auto _ : state) {
    std::memcpy(copied.data(), bytes.payload().data(), copied.size());
    benchmark::DoNotOptimize(copied.data());
    benchmark::ClobberMemory();
  }
  report(state, returns_of(packet), velodyne::packet_duration(model, mode));
}

} // namespace

void add_decoders(const Effort& effort) {
  constexpr std::size_t kPackets = 50'000;
  for (const velodyne::Model model : velodyne::kModels) {
    for (const auto mode : {velodyne::ReturnMode::strongest, velodyne::ReturnMode::dual}) {
      const std::string lidar = std::string{to_string(model)} + '/' + std::string{to_string(mode)};
      add("decode/" + lidar, effort, kPackets, [=](auto& state) {
        decode(state, model, mode);
      })->Unit(benchmark::kMicrosecond);
      add("memcpy/" + lidar, effort, kPackets, [=](auto& state) {
        copy(state, model, mode);
      })->Unit(benchmark::kMicrosecond);
    }
  }
}

} // namespace locus::performance
