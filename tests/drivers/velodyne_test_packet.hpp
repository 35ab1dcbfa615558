// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/velodyne/model.hpp"

namespace locus::test {

/// A data packet made byte by byte: well-formed, rotating at `rpm`, all distances 0 until set.
class VelodyneTestPacket {
 public:
  VelodyneTestPacket(velodyne::Model model, velodyne::ReturnMode mode, std::uint32_t time_of_hour_us = 1'000'000,
                     std::uint16_t azimuth_cdeg = 0, double rpm = 600.0, velodyne::Pace pace = velodyne::Pace::first) {
    using namespace velodyne;
    const PacketLayout layout = packet_layout(model, mode);
    const double turn_cdeg = rpm / 60.0 * kCdegPerTurn * to_seconds(spec(model, pace).column_duration);
    for (std::size_t block = 0; block < layout.used_blocks(); ++block) {
      const std::size_t column = block / layout.blocks_per_column();
      set_flag(block, kBankFlags[block % layout.blocks_per_column() / layout.returns]);
      const auto turned_cdeg = static_cast<unsigned>(std::lround(turn_cdeg * static_cast<double>(column)));
      set_azimuth(block, static_cast<std::uint16_t>((azimuth_cdeg + turned_cdeg) % kCdegPerTurn));
    }
    set_time_of_hour(time_of_hour_us);
    bytes_[kReturnModeOffset] = static_cast<std::byte>(mode);
    set_product_id(spec(model).product_id);
  }

  void set_flag(std::size_t block, std::uint16_t flag) { put(block * velodyne::kBlockBytes, flag, 2); }
  void set_azimuth(std::size_t block, std::uint16_t cdeg) { put(block * velodyne::kBlockBytes + 2, cdeg, 2); }
  void set_return(std::size_t block, std::size_t channel, std::uint16_t distance, std::uint8_t intensity = 10) {
    const std::size_t at =
        block * velodyne::kBlockBytes + velodyne::kBlockHeaderBytes + channel * velodyne::kChannelBytes;
    put(at, distance, 2);
    put(at + 2, intensity, 1);
  }
  void set_all_returns(std::uint16_t distance) {
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel)
        set_return(block, channel, distance);
  }
  void set_time_of_hour(std::uint32_t us) { put(velodyne::kTimeOffset, us, 4); }
  void set_product_id(std::uint8_t id) { bytes_[velodyne::kProductIdOffset] = std::byte{id}; }
  void set_return_mode(std::uint8_t mode) { bytes_[velodyne::kReturnModeOffset] = std::byte{mode}; }

  [[nodiscard]] std::span<const std::byte> payload() const { return bytes_; }

 private:
  void put(std::size_t at, std::uint32_t value, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      bytes_[at + i] = static_cast<std::byte>(value >> (8 * i));
  }

  std::array<std::byte, velodyne::kDataPacketBytes> bytes_{};
};

} // namespace locus::test
