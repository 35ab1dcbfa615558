// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_lidar.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>

namespace locus::sim {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr double kTellingApart_m = 1.0; // echoes nearer to each other than this are one
constexpr int kDataPacketsPerPosition = 5;

// Velodyne's data sheets: a surface that throws back a tenth of the light is seen at about half the reach.
constexpr double kDark = 10, kReachOfDark = 0.5;

// Position packet, VLP-16 user manual 63-9243, section 9.4.
constexpr std::uint16_t kPositionPort = 8308;
constexpr std::size_t kPositionTimeOffset = 198, kPpsOffset = 202, kNmeaOffset = 206;
constexpr std::byte kPpsAbsent{0}, kPpsLocked{2};

template <std::size_t Size>
void put(std::array<std::byte, Size>& bytes, std::size_t offset, std::uint32_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    bytes[offset + i] = static_cast<std::byte>(value >> (8 * i));
}

/// GPRMC: recommended minimum of a satellite receiver, with the time and date of the last whole second.
std::string gprmc(Stamp stamp, bool valid_fix) {
  const std::time_t second = std::chrono::floor<std::chrono::seconds>(stamp).time_since_epoch().count();
  const std::string body = fmt::format("GPRMC,{0:%H%M%S},{1},4801.0000,N,01131.0000,E,000.0,000.0,{0:%d%m%y},000.0,W",
                                       fmt::gmtime(second), valid_fix ? 'A' : 'V');
  const auto checksum = std::accumulate(body.begin(), body.end(), 0, [](int sum, char c) { return sum ^ c; });
  return fmt::format("${}*{:02X}\r\n", body, checksum);
}

} // namespace

struct SyntheticLidar::Mount {
  Stamp fired;
  Eigen::Matrix3d R_world_lidar;
  Eigen::Matrix3d R_world_rotor;
  Eigen::Vector3d position_m;
  Eigen::Vector3d velocity_mps;
  Eigen::Vector3d angular_velocity_radps; ///< all in world frame, at the first firing of the column

  Mount(Stamp stamp, const BaseMotion& base, const Pose& T_base_lidar, double azimuth_rad) : fired(stamp) {
    const Pose T_world_lidar = base.T_world_base * T_base_lidar;
    R_world_lidar = T_world_lidar.R();
    R_world_rotor = R_world_lidar * Eigen::AngleAxisd(-azimuth_rad, Eigen::Vector3d::UnitZ());
    position_m = T_world_lidar.translation;
    angular_velocity_radps = base.T_world_base.rotation * base.angular_velocity_base_radps;
    velocity_mps = base.velocity_world_mps + angular_velocity_radps.cross(position_m - base.T_world_base.translation);
  }
};

SyntheticLidar::SyntheticLidar(const Scene& scene, const Trajectory& trajectory, const SyntheticLidarOptions& options,
                               SeenSpace* seen)
    : scene_(scene), trajectory_(trajectory), options_(options), spec_(velodyne::spec(options.model)),
      layout_(velodyne::packet_layout(options.model, options.return_mode)), dice_(options.seed), seen_(seen),
      packet_begin_(trajectory.start()), data_packets_until_position_(kDataPacketsPerPosition) {
  const double rotor_rate_radps = options.rpm / 60 * kTurn_rad;
  for (const velodyne::Firing& firing : spec_.firings()) {
    const velodyne::Laser& laser = spec_.calibration.lasers()[firing.laser];
    const double azimuth_rad = rotor_rate_radps * 1e-9 * firing.offset_ns + laser.azimuth_offset_rad;
    const double level = std::cos(laser.elevation_rad);
    aims_.push_back({{level * std::cos(azimuth_rad), -level * std::sin(azimuth_rad), std::sin(laser.elevation_rad)},
                     laser.vertical_offset_m,
                     Duration{firing.offset_ns}});
  }
}

Datagram SyntheticLidar::next() {
  if (options_.sends_position_packets && data_packets_until_position_ == 0) {
    data_packets_until_position_ = kDataPacketsPerPosition;
    fill_position_packet();
    return datagram(position_, kPositionPort);
  }
  --data_packets_until_position_;
  fill_data_packet();
  packet_begin_ += velodyne::packet_duration(options_.model, options_.return_mode);
  return datagram(data_, options_.port);
}

Datagram SyntheticLidar::datagram(std::span<const std::byte> payload, std::uint16_t port) {
  return {.payload = payload,
          .source_ip = options_.source_ip,
          .source_port = port,
          .destination_port = port,
          .receive_stamp = arrival()};
}

/// Packets wait for each other: none overtakes.
Stamp SyntheticLidar::arrival() {
  const Duration delay = options_.latency > Duration::zero()
                             ? from_seconds(-to_seconds(options_.latency) * std::log1p(-dice_.uniform()))
                             : Duration::zero();
  last_arrival_ = std::max(last_arrival_, packet_begin_ + delay);
  return last_arrival_;
}

void SyntheticLidar::fill_data_packet() {
  for (std::size_t column = 0; column < layout_.columns; ++column)
    fill_column(column);
  put(data_, velodyne::kTimeOffset, microseconds_past_hour(packet_begin_ + spec_.stamp_delay), 4);
  data_[velodyne::kReturnModeOffset] = static_cast<std::byte>(options_.return_mode);
  data_[velodyne::kProductIdOffset] = static_cast<std::byte>(spec_.product_id);
}

void SyntheticLidar::fill_column(std::size_t column) {
  const Stamp fired = packet_begin_ + static_cast<Duration::rep>(column) * spec_.column_duration;
  put_block_headers(column, fired);
  const Mount mount(fired, trajectory_.at(fired), options_.T_base_lidar, rotor_azimuth_rad(fired));
  const std::size_t first_block = column * layout_.blocks_per_column();
  for (std::size_t i = 0; i < aims_.size(); ++i) {
    const std::size_t block = first_block + i / velodyne::kChannels * layout_.returns;
    const Echoes echoes = fire(mount, aims_[i]);
    if (layout_.returns == 2) {
      put_echo(block, i % velodyne::kChannels, echoes.last);
      put_echo(block + 1, i % velodyne::kChannels, echoes.strongest);
    } else {
      const bool wants_last = options_.return_mode == velodyne::ReturnMode::last;
      put_echo(block, i % velodyne::kChannels, wants_last ? echoes.last : echoes.strongest);
    }
  }
}

void SyntheticLidar::put_block_headers(std::size_t column, Stamp fired) {
  const double azimuth_cdeg = rotor_azimuth_rad(fired) * velodyne::kCdegPerTurn / kTurn_rad;
  const auto reported = static_cast<std::uint32_t>(std::lround(azimuth_cdeg)) % velodyne::kCdegPerTurn;
  for (std::size_t i = 0; i < layout_.blocks_per_column(); ++i) {
    const std::size_t offset = (column * layout_.blocks_per_column() + i) * velodyne::kBlockBytes;
    put(data_, offset, velodyne::kBankFlags[i / layout_.returns], 2);
    put(data_, offset + 2, reported, 2);
  }
}

void SyntheticLidar::put_echo(std::size_t block, std::size_t channel, const Echo& echo) {
  const std::size_t offset =
      block * velodyne::kBlockBytes + velodyne::kBlockHeaderBytes + channel * velodyne::kChannelBytes;
  put(data_, offset, echo.ticks, 2);
  put(data_, offset + 2, echo.intensity, 1);
}

SyntheticLidar::Echoes SyntheticLidar::fire(const Mount& mount, Aim& aim) {
  const auto center = look(mount, aim, 0);
  aim.met = center ? center->surface : nullptr;
  const Echo center_echo = measure(center);
  if (options_.dust > 0 && dice_.uniform() < options_.dust) {
    const Echo grain = measure_dust();
    if (center_echo.ticks == 0 || grain.ticks < center_echo.ticks)
      return {center_echo.ticks == 0 ? grain : center_echo, grain};
  }
  if (options_.return_mode != velodyne::ReturnMode::dual)
    return {center_echo, center_echo};

  const auto edge = look(mount, aim, kHalfBeam_rad);
  if (!center || !edge || std::abs(edge->range_m - center->range_m) < kTellingApart_m)
    return {center_echo, center_echo};
  const Echo edge_echo = measure(edge);
  if (edge_echo.ticks == 0 || center_echo.ticks == 0) // one of them was lost
    return edge_echo.ticks == 0 ? Echoes{center_echo, center_echo} : Echoes{edge_echo, edge_echo};
  // When the strongest return is also the last, the sensor reports the second strongest in its place.
  return edge->range_m > center->range_m ? Echoes{edge_echo, center_echo} : Echoes{center_echo, edge_echo};
}

/// The motion within a column is followed to first order: over its 0.1 ms the rest is below 1e-7 m and 1e-7 rad.
std::optional<Hit> SyntheticLidar::look(const Mount& mount, const Aim& aim, double aside_rad) const {
  const double since_s = to_seconds(aim.after);
  Eigen::Vector3d aimed = mount.R_world_rotor * aim.direction;
  if (aside_rad != 0)
    aimed = Eigen::AngleAxisd(-aside_rad, mount.R_world_lidar.col(2)) * aimed;
  const Ray ray{mount.position_m + since_s * mount.velocity_mps + aim.origin_z_m * mount.R_world_lidar.col(2),
                aimed + since_s * mount.angular_velocity_radps.cross(aimed)};
  return scene_.cast(ray, options_.max_range_m, mount.fired + aim.after, aim.met);
}

SyntheticLidar::Echo SyntheticLidar::measure(const std::optional<Hit>& hit) {
  if (!hit || (options_.dropout > 0 && dice_.uniform() < options_.dropout))
    return {};
  double noise_m = options_.range_noise_m, brightness = hit->reflectivity;
  if (options_.fades) {
    const double nearness = kReachOfDark * options_.max_range_m / hit->range_m;
    const double strength = brightness / kDark * hit->cos_incidence * nearness * nearness;
    if (is_lost(strength))
      return {};
    noise_m *= 1 + 1 / strength;
    brightness *= 0.5 * (1 + hit->cos_incidence) * (0.9 + 0.2 * dice_.uniform()); // not quite calibrated away
  }
  const double range_m = noise_m > 0 ? hit->range_m + noise_m * dice_.normal() : hit->range_m;
  const double ticks = std::round(range_m / spec_.calibration.distance_resolution_m);
  if (range_m < options_.min_range_m || ticks > 65'535)
    return {};
  if (seen_ != nullptr && !hit->apparent)
    seen_->mark(hit->point_m);
  return {static_cast<std::uint16_t>(ticks), static_cast<std::uint8_t>(std::clamp(brightness, 1.0, 255.0))};
}

/// Echoes do not end at once: some a little above the threshold are lost, some a little below are not.
bool SyntheticLidar::is_lost(double strength) {
  constexpr double kNever = 1.4, kAlways = 0.8;
  return strength < kNever && dice_.uniform() * (kNever - kAlways) > strength - kAlways;
}

SyntheticLidar::Echo SyntheticLidar::measure_dust() {
  constexpr double kMeanWay_m = 2.5;
  const double range_m = options_.min_range_m - kMeanWay_m * std::log1p(-dice_.uniform());
  const double ticks = std::min(65'535.0, std::round(range_m / spec_.calibration.distance_resolution_m));
  return {static_cast<std::uint16_t>(ticks), static_cast<std::uint8_t>(1 + 8 * dice_.uniform())};
}

/// 0 .. 2 pi, clockwise seen from above.
double SyntheticLidar::rotor_azimuth_rad(Stamp stamp) const {
  const double turns = to_seconds(stamp - trajectory_.start()) * options_.rpm / 60 + options_.first_azimuth_deg / 360;
  return (turns - std::floor(turns)) * kTurn_rad;
}

std::uint32_t SyntheticLidar::microseconds_past_hour(Stamp stamp) const {
  const auto shown = (stamp + options_.clock_offset).time_since_epoch();
  return static_cast<std::uint32_t>(
      std::chrono::floor<std::chrono::microseconds>(shown % std::chrono::hours{1}).count());
}

void SyntheticLidar::fill_position_packet() {
  put(position_, kPositionTimeOffset, microseconds_past_hour(packet_begin_), 4);
  position_[kPpsOffset] = options_.pps_locked ? kPpsLocked : kPpsAbsent;
  const std::string sentence = gprmc(packet_begin_ + options_.clock_offset, options_.pps_locked);
  std::memcpy(position_.data() + kNmeaOffset, sentence.data(), sentence.size());
}

} // namespace locus::sim
