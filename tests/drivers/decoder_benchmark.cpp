// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>

#include "drivers/velodyne_decoder.hpp"
#include "velodyne_test_packet.hpp"

namespace {

using namespace locus;

/// One packet after the other of a full scene, two thirds of the firings with a return.
void decode(benchmark::State& state, velodyne::Model model, velodyne::ReturnMode mode) {
  test::VelodyneTestPacket bytes{model, mode, 1'000'000, 100};
  std::uint32_t random = 1;
  for (std::size_t block = 0; block < velodyne::kBlocks; ++block) {
    for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
      random = random * 1'664'525U + 1'013'904'223U;
      bytes.set_return(block, channel, static_cast<std::uint16_t>(random >> 30 == 0 ? 0 : random >> 16));
    }
  }
  velodyne::Decoder decoder{{.model = model}};
  LidarPacket packet;
  for (auto _ : state) {
    decoder.decode(bytes.payload(), packet);
    benchmark::DoNotOptimize(packet.count);
    benchmark::ClobberMemory();
  }
  const double packet_s = to_seconds(velodyne::packet_duration(model, mode));
  state.counters["per_core"] = benchmark::Counter(packet_s, benchmark::Counter::kIsIterationInvariantRate); // lidars
}

} // namespace

int main(int argc, char** argv) {
  for (const velodyne::Model model : velodyne::kModels)
    for (const auto mode : {velodyne::ReturnMode::strongest, velodyne::ReturnMode::dual})
      benchmark::RegisterBenchmark((std::string{to_string(model)} + '/' + std::string{to_string(mode)}).c_str(), decode,
                                   model, mode);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
