// SPDX-License-Identifier: Apache-2.0
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "drivers/velodyne/model.hpp"
#include "locus_sim/packet_writer.hpp"
#include "locus_sim/synthetic_lidar.hpp"

namespace locus::sim {
namespace {

// Position packet, VLP-16 user manual 63-9243, section 9.4.
constexpr std::size_t kPositionTimeOffset = 198, kPpsOffset = 202, kNmeaOffset = 206;
constexpr std::byte kPpsAbsent{0}, kPpsLocked{2};

/// Converts the reading of the clock; 0 <= result < 1 h.
std::uint32_t microseconds_past_hour(Stamp shown) {
  return static_cast<std::uint32_t>(
      std::chrono::floor<std::chrono::microseconds>(shown.time_since_epoch() % std::chrono::hours{1}).count());
}

FiringPattern pattern_of(const SyntheticLidarOptions& options, velodyne::Model model) {
  const velodyne::ModelSpec& spec = velodyne::spec(model);
  FiringPattern pattern{.lasers = {},
                        .firings = {},
                        .columns = velodyne::packet_layout(model, options.return_mode).columns,
                        .column_duration = spec.column_duration,
                        .rpm = options.rpm,
                        .first_azimuth_deg = options.first_azimuth_deg,
                        .resolution_m = spec.calibration.distance_resolution_m,
                        .most_ticks = 0xFFFF};
  for (const velodyne::Laser& laser : spec.calibration.lasers())
    pattern.lasers.push_back({laser.elevation_rad, laser.azimuth_offset_rad, laser.vertical_offset_m});
  for (const velodyne::Firing& firing : spec.firings())
    pattern.firings.push_back({firing.laser, Duration{firing.offset_ns}});
  return pattern;
}

class VelodyneWriter : public PacketWriter {
 public:
  VelodyneWriter(const SyntheticLidarOptions& options, velodyne::Model model)
      : PacketWriter(pattern_of(options, model)), spec_(velodyne::spec(model)), mode_(options.return_mode),
        layout_(velodyne::packet_layout(model, options.return_mode)), clock_offset_(options.clock_offset) {}

  void begin_column(std::size_t column, Stamp, double azimuth_rad) override {
    const double azimuth_cdeg = azimuth_rad * velodyne::kCdegPerTurn / (2 * std::numbers::pi);
    const auto reported = static_cast<std::uint32_t>(std::lround(azimuth_cdeg)) % velodyne::kCdegPerTurn;
    for (std::size_t i = 0; i < layout_.blocks_per_column(); ++i) {
      const std::size_t offset = (column * layout_.blocks_per_column() + i) * velodyne::kBlockBytes;
      put(offset, velodyne::kBankFlags[i / layout_.returns], 2);
      put(offset + 2, reported, 2);
    }
  }

  void put(std::size_t column, std::size_t firing, const Echoes& echoes) override {
    const std::size_t block = column * layout_.blocks_per_column() + firing / velodyne::kChannels * layout_.returns;
    const std::size_t channel = firing % velodyne::kChannels;
    if (layout_.returns == 2) {
      put_echo(block, channel, echoes.last);
      put_echo(block + 1, channel, echoes.strongest);
    } else {
      put_echo(block, channel, mode_ == velodyne::ReturnMode::last ? echoes.last : echoes.strongest);
    }
  }

  std::span<const std::byte> finish(Stamp begin) override {
    put(velodyne::kTimeOffset, microseconds_past_hour(begin + spec_.stamp_delay + clock_offset_), 4);
    data_[velodyne::kReturnModeOffset] = static_cast<std::byte>(mode_);
    data_[velodyne::kProductIdOffset] = static_cast<std::byte>(spec_.product_id);
    return data_;
  }

 private:
  void put(std::size_t offset, std::uint32_t value, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      data_[offset + i] = static_cast<std::byte>(value >> (8 * i));
  }
  void put_echo(std::size_t block, std::size_t channel, const Echo& echo) {
    const std::size_t offset =
        block * velodyne::kBlockBytes + velodyne::kBlockHeaderBytes + channel * velodyne::kChannelBytes;
    put(offset, echo.ticks, 2);
    put(offset + 2, echo.intensity, 1);
  }

  const velodyne::ModelSpec& spec_;
  velodyne::ReturnMode mode_;
  velodyne::PacketLayout layout_;
  Duration clock_offset_;
  std::array<std::byte, velodyne::kDataPacketBytes> data_{};
};

template <std::size_t Size>
void put(std::array<std::byte, Size>& bytes, std::size_t offset, std::uint32_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    bytes[offset + i] = static_cast<std::byte>(value >> (8 * i));
}

/// Formats GPRMC: recommended minimum of a satellite receiver, with the time and date of the last whole second.
std::string gprmc(Stamp stamp, bool valid_fix) {
  const std::time_t second = std::chrono::floor<std::chrono::seconds>(stamp).time_since_epoch().count();
  const std::string body = fmt::format("GPRMC,{0:%H%M%S},{1},4801.0000,N,01131.0000,E,000.0,000.0,{0:%d%m%y},000.0,W",
                                       fmt::gmtime(second), valid_fix ? 'A' : 'V');
  const auto checksum = std::accumulate(body.begin(), body.end(), 0, [](int sum, char c) { return sum ^ c; });
  return fmt::format("${}*{:02X}\r\n", body, checksum);
}

} // namespace

std::unique_ptr<PacketWriter> velodyne_writer(const SyntheticLidarOptions& options) {
  return std::make_unique<VelodyneWriter>(options, std::get<velodyne::Model>(options.model));
}

void fill_position_packet(std::array<std::byte, kPositionPacketBytes>& packet, Stamp shown, bool pps_locked) {
  put(packet, kPositionTimeOffset, microseconds_past_hour(shown), 4);
  packet[kPpsOffset] = pps_locked ? kPpsLocked : kPpsAbsent;
  const std::string sentence = gprmc(shown, pps_locked);
  std::memcpy(packet.data() + kNmeaOffset, sentence.data(), sentence.size());
}

} // namespace locus::sim
