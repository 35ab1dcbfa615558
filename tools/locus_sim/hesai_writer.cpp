// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "locus_sim/hesai_packet.hpp"
#include "locus_sim/packet_writer.hpp"
#include "locus_sim/synthetic_lidar.hpp"

namespace locus::sim {
namespace {

constexpr std::uint8_t kStrongest = 0x37;

FiringPattern pattern_of(const SyntheticLidarOptions& options, const hesai::ModelSpec& spec) {
  const hesai::FiringSequence& sequence = spec.sequences.front();
  FiringPattern pattern{.lasers = {},
                        .firings = {},
                        .columns = spec.layout.blocks,
                        .column_duration = sequence.column_duration,
                        .rpm = options.rpm,
                        .first_azimuth_deg = options.first_azimuth_deg,
                        .resolution_m = HesaiPacket::kDistanceUnit_m,
                        .most_ticks = 0xFFFF};
  for (const hesai::Laser& laser : spec.calibration.lasers()) {
    pattern.firings.push_back({pattern.lasers.size(), Duration{sequence.offset_ns[pattern.lasers.size()]}});
    pattern.lasers.push_back({laser.elevation_rad, laser.azimuth_offset_rad, 0});
  }
  return pattern;
}

class HesaiWriter : public PacketWriter {
 public:
  HesaiWriter(const SyntheticLidarOptions& options, hesai::Model model)
      : PacketWriter(pattern_of(options, hesai::spec(model))), model_(model), clock_offset_(options.clock_offset) {}

  void begin_column(std::size_t column, Stamp, double azimuth_rad) override {
    if (column == 0)
      packet_.emplace(model_, kStrongest, HesaiPacket::kTime, std::uint16_t{0}, pattern().rpm);
    const double azimuth_cdeg = azimuth_rad * hesai::kCdegPerTurn / (2 * std::numbers::pi);
    packet_->set_azimuth(column, static_cast<std::uint16_t>(std::lround(azimuth_cdeg) % hesai::kCdegPerTurn));
  }

  void put(std::size_t column, std::size_t firing, const Echoes& echoes) override {
    const Echo& echo = echoes.strongest;
    packet_->set_return(column, firing, static_cast<std::uint16_t>(echo.ticks), echo.intensity);
  }

  std::span<const std::byte> finish(Stamp begin) override {
    const hesai::ModelSpec& spec = hesai::spec(model_);
    const auto last_column = static_cast<Duration::rep>(pattern().columns - 1);
    const Duration reported = spec.time_of_last_column ? last_column * pattern().column_duration : Duration{};
    packet_->set_time((begin + reported - spec.azimuth_delay + clock_offset_).time_since_epoch());
    packet_->set_number(++number_);
    packet_->seal();
    return packet_->payload();
  }

 private:
  hesai::Model model_;
  Duration clock_offset_;
  std::uint32_t number_ = 0;
  std::optional<HesaiPacket> packet_;
};

} // namespace

std::unique_ptr<PacketWriter> hesai_writer(const SyntheticLidarOptions& options) {
  return std::make_unique<HesaiWriter>(options, std::get<hesai::Model>(options.model));
}

} // namespace locus::sim
