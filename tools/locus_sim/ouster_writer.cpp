// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "locus_sim/ouster_packet.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "locus_sim/packet_writer.hpp"

namespace locus::sim {
namespace {

/// Returns the firing pattern. The encoder triggers the columns, so their period follows the motor speed, and the first
/// azimuth is rounded to a column, the first of a packet.
FiringPattern pattern_of(const SyntheticLidarOptions& options, const ouster::Metadata& metadata) {
  constexpr double kResolution_m = 1e-3;
  const auto columns = static_cast<double>(metadata.columns_per_frame);
  const auto packets = columns / static_cast<double>(metadata.columns_per_packet);
  const Duration column_duration = from_seconds(60 / (options.rpm * columns));
  FiringPattern pattern{.lasers = {},
                        .firings = {},
                        .columns = metadata.columns_per_packet,
                        .column_duration = column_duration,
                        .rpm = 60 / (to_seconds(column_duration) * columns) * (1 + options.drift),
                        .first_azimuth_deg = std::floor(options.first_azimuth_deg / 360 * packets) / packets * 360,
                        .resolution_m = kResolution_m,
                        .most_ticks = (1U << ouster::spec(metadata.profile).range_bits) - 1,
                        .origin_radius_m = metadata.beam_origin_radius_m,
                        .T_lidar_rotor = metadata.T_sensor_lidar};
  for (std::size_t i = 0; i < metadata.pixels_per_column; ++i) {
    pattern.lasers.push_back({metadata.altitude_rad[i], metadata.azimuth_rad[i], metadata.beam_origin_height_m});
    pattern.firings.push_back({i, Duration{}});
  }
  return pattern;
}

class OusterWriter : public PacketWriter {
 public:
  OusterWriter(const SyntheticLidarOptions& options, const OusterSensor& sensor)
      : PacketWriter(pattern_of(options, sensor.metadata())), sensor_(sensor) {}

  void begin_column(std::size_t column, Stamp own_time, double azimuth_rad) override {
    const auto turn = static_cast<double>(sensor_.metadata().columns_per_frame);
    const auto turned = static_cast<std::size_t>(std::lround(azimuth_rad / (2 * std::numbers::pi) * turn));
    const std::size_t id = turned % sensor_.metadata().columns_per_frame;
    const auto shown_ns = static_cast<std::uint64_t>(sensor_.shown_at(own_time).count());
    if (column == 0) {
      frame_ += id == 0 ? 1U : 0U;
      packet_.emplace(sensor_.metadata(), id, shown_ns, frame_);
    }
    packet_->set_measurement_id(column, id);
    packet_->set_time(column, shown_ns);
  }

  void put(std::size_t column, std::size_t firing, const Echoes& echoes) override {
    packet_->set_return(column, firing, echoes.strongest.ticks, echoes.strongest.intensity);
  }

  std::span<const std::byte> finish(Stamp) override {
    packet_->seal();
    return packet_->payload();
  }

 private:
  OusterSensor sensor_;
  std::uint32_t frame_ = 0;
  std::optional<OusterPacket> packet_;
};

} // namespace

std::unique_ptr<PacketWriter> ouster_writer(const SyntheticLidarOptions& options, Stamp start) {
  return std::make_unique<OusterWriter>(options, OusterSensor(options, start));
}

} // namespace locus::sim
