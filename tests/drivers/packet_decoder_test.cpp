// SPDX-License-Identifier: Apache-2.0
#include "drivers/packet_decoder.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>

#include <gtest/gtest.h>

#include "hesai_test_packet.hpp"
#include "velodyne_test_packet.hpp"

namespace locus {
namespace {

using test::HesaiTestPacket;
using test::VelodyneTestPacket;

constexpr Duration kTurn = std::chrono::milliseconds{200};

/// Decodes a packet. Returns the number of its firings in a turn, each of them counted with all its echoes.
double returns_in_a_turn(const LidarOptions& options, std::span<const std::byte> payload) {
  auto decoder = PacketDecoder::open(options);
  const auto packet = std::make_unique<LidarPacket>();
  if (decoder->decode(payload, Stamp{}, *packet))
    return 0.0;
  std::size_t returns = 0;
  for (std::size_t i = 0; i < packet->count; ++i)
    for (std::size_t k = 0; k < FiringGroup::kLasers; ++k)
      returns += packet->storage[i].range_m[k] > 0.0F ? 1U : 0U;
  return static_cast<double>(returns) * to_seconds(kTurn) / to_seconds(packet->duration);
}

/// The memory that is reserved for a sweep holds it in every return mode, and is at most twice the need.
TEST(PacketDecoder, MostReturnsOfAHesaiAreThoseOfItsRichestMode) {
  constexpr std::array<std::uint8_t, 3> kSingleDualTriple{0x33, 0x39, 0x3D};
  for (std::size_t i = 0; i < hesai::kModels; ++i) {
    const auto model = static_cast<hesai::Model>(i);
    LidarOptions options;
    options.hesai = model;
    double richest = 0.0;
    for (const std::uint8_t mode : kSingleDualTriple)
      for (const std::size_t sequence : {0U, 1U}) {
        HesaiTestPacket packet(model, mode, HesaiTestPacket::kTime, 0, 300.0, sequence);
        const hesai::PacketLayout& layout = hesai::spec(model).layout;
        const bool fires_in_part = model == hesai::Model::ot128 && sequence == 1; // three of four channels per column
        for (std::size_t block = 0; block < layout.blocks; ++block)
          for (std::size_t channel = 0; channel < layout.channels; ++channel)
            if (!fires_in_part || channel % 4 != 0)
              packet.set_return(block, channel, static_cast<std::uint16_t>(1000 + 100 * block));
        packet.seal();
        richest = std::max(richest, returns_in_a_turn(options, packet.payload()));
      }
    const auto most = static_cast<double>(most_returns(options, kTurn));
    EXPECT_GE(most, richest) << to_string(model);
    EXPECT_LE(most, 2.0 * richest) << to_string(model);
    EXPECT_LE(most_returns(options, kTurn), most_returns({}, kTurn));
  }
}

TEST(PacketDecoder, MostReturnsOfAVelodyneAreThoseOfDualMode) {
  for (const velodyne::Model model : velodyne::kModels) {
    LidarOptions options;
    options.model = model;
    VelodyneTestPacket packet(model, velodyne::ReturnMode::dual);
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel)
        packet.set_return(block, channel, static_cast<std::uint16_t>(1000 + 100 * block));
    const double richest = returns_in_a_turn(options, packet.payload());
    const auto most = static_cast<double>(most_returns(options, kTurn));
    EXPECT_GE(most, richest) << to_string(model);
    EXPECT_LE(most, 1.1 * richest) << to_string(model);
    EXPECT_LE(most_returns(options, kTurn), most_returns({}, kTurn));
  }
}

} // namespace
} // namespace locus
