// SPDX-License-Identifier: Apache-2.0
// Cost of decoding a return, compared with copying its bytes.
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "drivers/hesai/decoder.hpp"
#include "drivers/hesai_test_packet.hpp"
#include "drivers/ouster/decoder.hpp"
#include "drivers/ouster_test_packet.hpp"
#include "drivers/velodyne/decoder.hpp"
#include "drivers/velodyne_test_packet.hpp"
#include "suite.hpp"
#include "support/returns.hpp"

namespace locus::performance {

namespace {

/// A packet of a dense scene: three quarters of the firings have a return.
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

/// Reports seconds per return, and the number of such lidars that one core decodes.
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
  report(state, test::count_returns(packet), velodyne::packet_duration(model, mode));
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
  report(state, test::count_returns(packet), velodyne::packet_duration(model, mode));
}

/// A packet of a dense scene: three quarters of the pixels have a return.
test::OusterTestPacket full_packet(const ouster::Metadata& metadata) {
  test::OusterTestPacket bytes{metadata};
  std::uint32_t random = 1;
  const ouster::PacketFormat format = metadata.packet_format();
  for (std::size_t column = 0; column < format.columns_per_packet; ++column) {
    for (std::size_t pixel = 0; pixel < format.pixels_per_column; ++pixel) {
      for (std::size_t echo = 0; echo < format.profile.echoes; ++echo) {
        random = random * 1'664'525U + 1'013'904'223U;
        bytes.set_return(column, pixel, random >> 30 == 0 ? 0 : random >> 14, 10, echo);
      }
    }
  }
  bytes.seal();
  return bytes;
}

void decode_ouster(benchmark::State& state, const ouster::Metadata& metadata) {
  const test::OusterTestPacket bytes = full_packet(metadata);
  ouster::Decoder decoder{metadata};
  LidarPacket packet;
  for (auto _ : state) {
    decoder.decode(bytes.payload(), packet);
    benchmark::DoNotOptimize(packet.count);
    benchmark::ClobberMemory();
  }
  report(state, test::count_returns(packet), packet.duration);
}

/// A packet of a dense scene: three quarters of the firings have a return. A quarter of a QT128's channels does not
/// fire in a column.
test::HesaiTestPacket full_packet(hesai::Model model, std::uint8_t mode) {
  test::HesaiTestPacket bytes{model, mode};
  std::uint32_t random = 1;
  for (std::size_t block = 0; block < hesai::spec(model).layout.blocks; ++block) {
    for (std::size_t channel = 0; channel < hesai::spec(model).layout.channels; ++channel) {
      random = random * 1'664'525U + 1'013'904'223U;
      const std::size_t silent = mode == 0x37 ? block : 0; // of four; with two returns both blocks are of one firing
      const bool fires = model != hesai::Model::qt128 || channel / 32 != silent;
      if (fires && random >> 30 != 0)
        bytes.set_return(block, channel, static_cast<std::uint16_t>(random >> 16));
    }
  }
  bytes.seal();
  return bytes;
}

void decode_hesai(benchmark::State& state, hesai::Model model, std::uint8_t mode) {
  const test::HesaiTestPacket bytes = full_packet(model, mode);
  hesai::Decoder decoder;
  LidarPacket packet;
  for (auto _ : state) {
    decoder.decode(bytes.payload(), packet);
    benchmark::DoNotOptimize(packet.count);
    benchmark::ClobberMemory();
  }
  report(state, test::count_returns(packet), packet.duration);
}

} // namespace

void add_hesai_decoders(const Effort& effort) {
  constexpr std::size_t kPackets = 10'000;
  for (std::size_t i = 0; i < hesai::kModels; ++i) {
    const auto model = static_cast<hesai::Model>(i);
    for (const std::uint8_t mode : std::array<std::uint8_t, 2>{0x37, 0x39}) {
      add("decode_hesai/" + std::string{to_string(model)} + (mode == 0x37 ? "/strongest" : "/dual"), effort, kPackets,
          [=](auto& state) { decode_hesai(state, model, mode); })
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

void add_ouster_decoders(const Effort& effort) {
  constexpr std::size_t kPackets = 10'000;
  for (const std::size_t pixels : {32U, 128U}) {
    for (const auto profile : {ouster::Profile::legacy, ouster::Profile::rng19, ouster::Profile::rng19_dual,
                               ouster::Profile::rng15, ouster::Profile::fusa_rng15_dual}) {
      const ouster::Metadata metadata = test::ouster_metadata(profile, pixels);
      add("decode_ouster/" + metadata.product_line + '/' + std::string{spec(profile).name}, effort, kPackets,
          [=](auto& state) { decode_ouster(state, metadata); })
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

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
