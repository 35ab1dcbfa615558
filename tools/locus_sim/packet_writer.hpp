// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/pose.hpp"
#include "core/base/stamp.hpp"

namespace locus::sim {

struct SyntheticLidarOptions;

/// Directions and firing times of a lidar's lasers, from the tables (or metadata) of its decoder. A packet has columns:
/// firings that share one reported azimuth.
struct FiringPattern {
  struct Laser {
    double elevation_rad;
    double azimuth_offset_rad; ///< clockwise viewed from above
    double origin_z_m;
  };
  struct Firing {
    std::size_t laser;
    Duration after; ///< time after the column's azimuth
  };

  std::vector<Laser> lasers;
  std::vector<Firing> firings; ///< per column, in the order of the packet's channels
  std::size_t columns;         ///< per packet
  Duration column_duration;    ///< period, by the lidar's clock
  double rpm;
  double first_azimuth_deg; ///< first column
  double resolution_m;
  std::uint32_t most_ticks;
  double origin_radius_m = 0; ///< of the circle of beam origins, along the column; origin of the ranges is its centre
  std::optional<Pose> T_lidar_rotor{}; ///< from the frame of the azimuths to the lidar's; nothing: identical
};

struct Echo {
  std::uint32_t ticks = 0; ///< in units of the pattern's resolution; 0: none
  std::uint8_t intensity = 0;
};
struct Echoes {
  Echo last, strongest;
};

/// Writes data packets in the format of one kind of lidar. For each packet: its columns in order, each with the echo,
/// if any, of every firing, then finish(). One owner.
class PacketWriter {
 public:
  explicit PacketWriter(FiringPattern pattern) : pattern_(std::move(pattern)) {}
  PacketWriter(const PacketWriter&) = delete;
  PacketWriter& operator=(const PacketWriter&) = delete;
  virtual ~PacketWriter() = default;

  [[nodiscard]] const FiringPattern& pattern() const { return pattern_; }

  /// Expects `own_time` by the lidar's clock, before SyntheticLidarOptions::clock_offset; azimuth 0 .. 2 pi, clockwise.
  virtual void begin_column(std::size_t column, Stamp own_time, double azimuth_rad) = 0;
  virtual void put(std::size_t column, std::size_t firing, const Echoes& echoes) = 0;
  /// Returns the payload, valid until the next packet begins. `begin`: own time of its first column.
  virtual std::span<const std::byte> finish(Stamp begin) = 0;

 private:
  FiringPattern pattern_;
};

std::unique_ptr<PacketWriter> velodyne_writer(const SyntheticLidarOptions& options);
/// Writes single returns, whatever the options: the strongest.
std::unique_ptr<PacketWriter> hesai_writer(const SyntheticLidarOptions& options);
/// Writes single returns likewise. The sensor's clock starts some time before `start`.
std::unique_ptr<PacketWriter> ouster_writer(const SyntheticLidarOptions& options, Stamp start);

inline constexpr std::size_t kPositionPacketBytes = 512;
inline constexpr std::uint16_t kPositionPort = 8308;

/// Fills a Velodyne's position packet, of zeros or filled before. `shown`: reading of the sensor's clock, also in the
/// sentence of the satellite receiver. `pps_locked`: there are a pulse per second and a valid fix. Any thread.
void fill_position_packet(std::array<std::byte, kPositionPacketBytes>& packet, Stamp shown, bool pps_locked);

} // namespace locus::sim
