// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/synthetic_lidar.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "locus_sim/dice.hpp"
#include "locus_sim/footprint.hpp"

namespace locus::sim {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
constexpr int kDataPacketsPerPosition = 5;

// A Gaussian beam is reduced to five rays that match its moments up to the fifth (Gauss-Hermite): the centre, and four
// at the square root of three of its standard deviations. The divergence, to 1/e^2 of its brightness, is four of them.
constexpr double kSideWeight = 1.0 / 6;
const double kSideAt = std::sqrt(3.0) / 4; // in units of the divergence
constexpr double kNarrowness = 0.5; // vertical to horizontal divergence: 1.5 to 3.0 mrad, VLP-16 user manual 63-9243
constexpr double kPartingStep_m = 0.03;      // smaller steps vanish in the noise
constexpr std::size_t kColumnsPerGlance = 8; // an edge along the rotation is crossed slowly

constexpr double kMostSlant = 3; // in units of the slant at kSlant_deg and kSlantRange_m; more gives hardly an echo
constexpr double kWhite = 100;   // Velodyne's scale: the brightest diffuse reflector

// Velodyne's data sheets: at 10 % reflectivity the range is about half.
constexpr double kDark = 10, kReachOfDark = 0.5;

std::unique_ptr<PacketWriter> writer_for(const SyntheticLidarOptions& options, Stamp start) {
  if (is_ouster(options.model))
    return ouster_writer(options, start);
  return std::holds_alternative<hesai::Model>(options.model) ? hesai_writer(options) : velodyne_writer(options);
}

} // namespace

SyntheticLidar::SyntheticLidar(const Scene& scene, const Trajectory& trajectory, const SyntheticLidarOptions& options,
                               ObservedSpace* observed)
    : scene_(scene), trajectory_(trajectory), options_(options), writer_(writer_for(options, trajectory.start())),
      pattern_(writer_->pattern()),
      T_base_rotor_(pattern_.T_lidar_rotor ? options.T_base_lidar * *pattern_.T_lidar_rotor : options.T_base_lidar),
      dice_(options.seed), observed_(observed), packet_begin_(trajectory.start()),
      data_packets_until_position_(kDataPacketsPerPosition) {
  aim(options);
  if (options_.beam_rad > 0) {
    look_ahead(packet_begin_);
    look_ahead(packet_begin_ + pattern_.column_duration);
    before_ = now_;
  }
}

void SyntheticLidar::aim(const SyntheticLidarOptions& options) {
  const double rotor_rate_radps = pattern_.rpm / 60 * kTurn_rad;
  QuickDice laser_dice(seed_for(options.seed, "lasers"));
  std::vector<double> elevations_rad, biases_m;
  for (const FiringPattern::Laser& laser : pattern_.lasers) {
    elevations_rad.push_back(laser.elevation_rad + options.laser_elevation_rad * laser_dice.normal());
    biases_m.push_back(options.laser_bias_m * laser_dice.normal());
  }
  for (const auto& [index, after] : pattern_.firings) {
    const FiringPattern::Laser& laser = pattern_.lasers[index];
    const double azimuth_rad = rotor_rate_radps * 1e-9 * static_cast<double>(after.count()) + laser.azimuth_offset_rad;
    const double elevation_rad = elevations_rad[index], level = std::cos(elevation_rad);
    aims_.push_back({{level * std::cos(azimuth_rad), -level * std::sin(azimuth_rad), std::sin(elevation_rad)},
                     laser.origin_z_m,
                     after,
                     biases_m[index]});
  }
}

Datagram SyntheticLidar::next() {
  if (options_.sends_position_packets && data_packets_until_position_ == 0) {
    data_packets_until_position_ = kDataPacketsPerPosition;
    fill_position_packet(position_, packet_begin_ + options_.clock_offset, options_.pps_locked);
    return datagram(position_, kPositionPort);
  }
  --data_packets_until_position_;
  for (std::size_t column = 0; column < pattern_.columns; ++column)
    fire_column(column);
  const std::span<const std::byte> payload = writer_->finish(packet_begin_);
  packet_begin_ += static_cast<Duration::rep>(pattern_.columns) * pattern_.column_duration;
  return datagram(payload, options_.port);
}

Datagram SyntheticLidar::datagram(std::span<const std::byte> payload, std::uint16_t port) {
  return {.payload = payload,
          .source_ip = options_.source_ip,
          .source_port = port,
          .destination_port = port,
          .receive_stamp = arrival()};
}

/// Returns the arrival; packets queue and never overtake each other.
Stamp SyntheticLidar::arrival() {
  const Duration delay = options_.latency > Duration::zero()
                             ? from_seconds(-to_seconds(options_.latency) * std::log1p(-dice_.uniform()))
                             : Duration::zero();
  last_arrival_ = std::max(last_arrival_, true_time(packet_begin_) + delay);
  return last_arrival_;
}

void SyntheticLidar::fire_column(std::size_t column) {
  const Stamp own_time = packet_begin_ + static_cast<Duration::rep>(column) * pattern_.column_duration;
  const Stamp fired = true_time(own_time);
  writer_->begin_column(column, own_time, rotor_azimuth_rad(fired));
  const bool is_line = options_.beam_rad <= 0;
  const Mount mount = is_line ? mount_at(fired) : now_.mount;
  for (std::size_t i = 0; i < aims_.size(); ++i)
    writer_->put(column, i, is_line ? fire_line(mount, aims_[i]) : fire_beam(i));
  ++columns_fired_;
  if (!is_line)
    look_ahead(own_time + 2 * pattern_.column_duration);
}

SyntheticLidar::Mount SyntheticLidar::mount_at(Stamp fired) const {
  const BaseMotion base = trajectory_.at(fired);
  const Pose T_world_lidar = base.T_world_base * T_base_rotor_;
  Mount mount{.fired = fired,
              .R_world_lidar = T_world_lidar.R(),
              .R_world_rotor = {},
              .R_base_world = base.T_world_base.R().transpose(),
              .position_m = T_world_lidar.translation,
              .velocity_mps = {},
              .angular_velocity_radps = base.T_world_base.rotation * base.angular_velocity_base_radps};
  mount.R_world_rotor = mount.R_world_lidar * Eigen::AngleAxisd(-rotor_azimuth_rad(fired), Eigen::Vector3d::UnitZ());
  mount.velocity_mps =
      base.velocity_world_mps + mount.angular_velocity_radps.cross(mount.position_m - base.T_world_base.translation);
  return mount;
}

/// Casts a ray. Motion within a column is first order: over its 0.1 ms the rest is below 1e-7 m and 1e-7 rad.
std::optional<SyntheticLidar::Sight> SyntheticLidar::look(const Mount& mount, const Aim& aim,
                                                          const Eigen::Vector3d& aimed) const {
  const double since_s = to_seconds(aim.after);
  const Ray ray{mount.position_m + since_s * mount.velocity_mps + aim.origin_z_m * mount.R_world_lidar.col(2) +
                    pattern_.origin_radius_m * mount.R_world_rotor.col(0),
                aimed + since_s * mount.angular_velocity_radps.cross(aimed)};
  std::optional<Sight> sight;
  if (const auto hit = scene_.cast(ray, options_.max_range_m, mount.fired + aim.after, aim.met))
    sight = Sight{*hit};
  if (!options_.own_parts.empty())
    consider_own_parts(mount, aim, aimed, sight);
  return sight;
}

/// Intersects the ray with the robot's own parts, which move with the lidar.
void SyntheticLidar::consider_own_parts(const Mount& mount, const Aim& aim, const Eigen::Vector3d& aimed,
                                        std::optional<Sight>& sight) const {
  const Ray ray{T_base_rotor_ * Eigen::Vector3d{0, 0, aim.origin_z_m} +
                    pattern_.origin_radius_m * (mount.R_base_world * mount.R_world_rotor.col(0)),
                mount.R_base_world * aimed};
  for (const Surface& part : options_.own_parts) {
    const double range_m = std::visit([&](const auto& shape) { return shape.range_m(ray); }, part.shape);
    if (range_m >= (sight ? sight->hit.range_m : options_.max_range_m))
      continue;
    const Eigen::Vector3d point_m = ray.origin_m + range_m * ray.direction;
    const Eigen::Vector3d normal = std::visit([&](const auto& shape) { return shape.normal(point_m); }, part.shape);
    sight = Sight{{point_m, range_m, std::abs(normal.dot(ray.direction)), part.reflectivity, nullptr, normal}, true};
  }
}

Echoes SyntheticLidar::fire_line(const Mount& mount, Aim& aim) {
  const Eigen::Vector3d aimed = mount.R_world_rotor * aim.direction;
  const auto center = look(mount, aim, aimed);
  aim.met = center ? center->hit.surface : nullptr;
  const Echo center_echo = measure(aim, center);
  if (const auto grain = meet_dust(center_echo))
    return {center_echo.ticks == 0 ? *grain : center_echo, *grain};
  if (options_.return_mode != velodyne::ReturnMode::dual)
    return {center_echo, center_echo};

  const auto edge = look(mount, aim, Eigen::AngleAxisd(-kHalfBeam_rad, mount.R_world_lidar.col(2)) * aimed);
  if (!center || !edge || std::abs(edge->hit.range_m - center->hit.range_m) < kRangeResolution_m)
    return {center_echo, center_echo};
  const Echo edge_echo = measure(aim, edge);
  if (edge_echo.ticks == 0 || center_echo.ticks == 0) // one of them was lost
    return edge_echo.ticks == 0 ? Echoes{center_echo, center_echo} : Echoes{edge_echo, edge_echo};
  // When the strongest return is also the last, the sensor reports the second strongest instead.
  return edge->hit.range_m > center->hit.range_m ? Echoes{edge_echo, center_echo} : Echoes{center_echo, edge_echo};
}

/// Casts the centre rays of beams one column before they are fired: an edge that consecutive beams approach shows in
/// the following one.
void SyntheticLidar::look_ahead(Stamp own_time) {
  std::swap(before_, now_);
  std::swap(now_, ahead_);
  ahead_.mount = mount_at(true_time(own_time));
  ahead_.centers.clear();
  for (Aim& aim : aims_) {
    const auto center = look(ahead_.mount, aim, ahead_.mount.R_world_rotor * aim.direction);
    aim.met = center ? center->hit.surface : nullptr;
    ahead_.centers.push_back(center);
  }
}

Echoes SyntheticLidar::fire_beam(std::size_t index) {
  const Aim& aim = aims_[index];
  Footprint beam = footprint(index);
  beam.merge();
  Echoes echoes;
  if (!beam.empty()) {
    const bool dual = options_.return_mode == velodyne::ReturnMode::dual;
    const Sight &last = beam.last(), &strongest = dual ? beam.strongest_beside_last() : beam.strongest();
    echoes.last = measure(aim, last);
    echoes.strongest = &strongest == &last ? echoes.last : measure(aim, strongest);
    if (dual && echoes.last.ticks == 0) // one of them was lost
      echoes.last = echoes.strongest;
    if (dual && echoes.strongest.ticks == 0)
      echoes.strongest = echoes.last;
  }
  if (const auto grain = meet_dust(echoes.strongest))
    return {echoes.last.ticks == 0 ? *grain : echoes.last, *grain};
  return echoes;
}

/// Casts side rays where an edge may split the beam; elsewhere they equal the centre ray. Vertical splits persist along
/// the rotation for a while: an occasional check finds their start.
SyntheticLidar::Footprint SyntheticLidar::footprint(std::size_t index) {
  Aim& aim = aims_[index];
  const std::optional<Sight>& center = now_.centers[index];
  const Eigen::Vector3d aimed = now_.mount.R_world_rotor * aim.direction;
  const Eigen::Vector3d left = now_.mount.R_world_lidar.col(2).cross(aimed).normalized(), up = aimed.cross(left);
  const double away = kSideAt * options_.beam_rad;
  Footprint beam;
  double middle_weight = 1;
  const auto look_aside = [&](const Eigen::Vector3d& side) {
    auto sight = look(now_.mount, aim, (aimed + side).normalized());
    beam.add(sight, kSideWeight);
    middle_weight -= kSideWeight;
    return sight;
  };
  if (is_parted_along_turn(index)) {
    look_aside(away * left);
    look_aside(-away * left);
  }
  if (aim.near_edge || (columns_fired_ + index) % kColumnsPerGlance == 0) {
    const auto above = look_aside(kNarrowness * away * up), below = look_aside(-kNarrowness * away * up);
    aim.near_edge = above.has_value() != below.has_value() ||
                    (above && center && below &&
                     std::abs(above->hit.range_m - 2 * center->hit.range_m + below->hit.range_m) > kPartingStep_m);
  }
  beam.add(center, middle_weight);
  return beam;
}

/// Returns whether an edge splits the beam: on one surface, or on adjoining ones, three columns' ranges are nearly
/// collinear.
bool SyntheticLidar::is_parted_along_turn(std::size_t index) const {
  const std::optional<Sight>&a = before_.centers[index], &b = now_.centers[index], &c = ahead_.centers[index];
  if (!a || !b || !c)
    return a || b || c;
  if (b->hit.surface != nullptr && a->hit.surface == b->hit.surface && b->hit.surface == c->hit.surface)
    return false;
  return std::abs(a->hit.range_m - 2 * b->hit.range_m + c->hit.range_m) > kPartingStep_m;
}

/// Returns the echo of dust; nothing if the pulse hits none, or only behind its target.
std::optional<Echo> SyntheticLidar::meet_dust(const Echo& nearest) {
  if (options_.dust <= 0 || dice_.uniform() >= options_.dust)
    return std::nullopt;
  const Echo grain = measure_dust();
  if (nearest.ticks != 0 && grain.ticks >= nearest.ticks)
    return std::nullopt;
  return grain;
}

Echo SyntheticLidar::measure(const Aim& aim, const std::optional<Sight>& sight) {
  if (!sight || (options_.dropout > 0 && dice_.uniform() < options_.dropout))
    return {};
  const Hit& hit = sight->hit;
  double noise_m = options_.range_noise_m, brightness = hit.reflectivity;
  if (options_.fades) {
    const double nearness = kReachOfDark * options_.max_range_m / hit.range_m;
    const double strength = brightness / kDark * hit.cos_incidence * nearness * nearness;
    if (is_lost(strength))
      return {};
    noise_m *= 1 + 1 / strength;
    brightness *= 0.5 * (1 + hit.cos_incidence) * (0.9 + 0.2 * dice_.uniform()); // residual of the calibration
  }
  const double wrong_m = hit.range_m + pattern_.origin_radius_m + aim.bias_m + bias_of_surface_m(hit);
  const double range_m = noise_m > 0 ? wrong_m + noise_m * dice_.normal() : wrong_m;
  const double ticks = std::round(range_m / pattern_.resolution_m);
  if (range_m < options_.min_range_m || ticks > pattern_.most_ticks)
    return {};
  if (observed_ != nullptr && !sight->is_own_part && !hit.apparent)
    observed_->mark(hit.point_m);
  return {static_cast<std::uint32_t>(ticks), static_cast<std::uint8_t>(std::clamp(brightness, 1.0, 255.0))};
}

/// Returns the range bias, constant for a given hit. At oblique incidence the pulse is stretched over the depth of its
/// footprint, range times tangent; its detected edge or peak shifts with the square of a stretch that is short compared
/// with the pulse. A weak pulse is detected later than a strong one (range walk).
double SyntheticLidar::bias_of_surface_m(const Hit& hit) const {
  double bias_m = 0;
  if (options_.incidence_bias_m > 0) {
    const double sine = std::sqrt(std::max(0.0, 1 - hit.cos_incidence * hit.cos_incidence));
    const double reference = kSlantRange_m * std::tan(kRadPerDeg * kSlant_deg);
    const double slant = std::min(kMostSlant, hit.range_m * sine / std::max(1e-6, hit.cos_incidence) / reference);
    bias_m += options_.incidence_bias_m * slant * slant;
  }
  if (options_.intensity_bias_m > 0)
    bias_m += options_.intensity_bias_m * (1 - std::min(1.0, hit.reflectivity / kWhite));
  return bias_m;
}

/// Decides at random near the threshold: some echoes a little above it are lost, some a little below it are not.
bool SyntheticLidar::is_lost(double strength) {
  constexpr double kNever = 1.4, kAlways = 0.8;
  return strength < kNever && dice_.uniform() * (kNever - kAlways) > strength - kAlways;
}

Echo SyntheticLidar::measure_dust() {
  constexpr double kMeanWay_m = 2.5;
  const double range_m = options_.min_range_m - kMeanWay_m * std::log1p(-dice_.uniform());
  const double ticks = std::min(static_cast<double>(pattern_.most_ticks), std::round(range_m / pattern_.resolution_m));
  return {static_cast<std::uint32_t>(ticks), static_cast<std::uint8_t>(1 + 8 * dice_.uniform())};
}

/// Converts a time of the lidar's clock, which also times the firings, to true time by removing the drift. Within a
/// column that is 5 ns, and neglected.
Stamp SyntheticLidar::true_time(Stamp own_time) const {
  const auto own_ns = static_cast<double>((own_time - trajectory_.start()).count());
  return own_time - Duration{std::llround(own_ns * options_.drift / (1 + options_.drift))};
}

/// Returns 0 .. 2 pi, clockwise viewed from above.
double SyntheticLidar::rotor_azimuth_rad(Stamp stamp) const {
  const double turns = to_seconds(stamp - trajectory_.start()) * pattern_.rpm / 60 + pattern_.first_azimuth_deg / 360;
  return (turns - std::floor(turns)) * kTurn_rad;
}

} // namespace locus::sim
