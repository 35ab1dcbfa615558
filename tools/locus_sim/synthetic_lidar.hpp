// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/pose.hpp"
#include "drivers/net/datagram.hpp"
#include "locus_sim/lidar_model.hpp"
#include "locus_sim/observed_space.hpp"
#include "locus_sim/packet_writer.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

/// Offset of the right edge of the beam, which in dual return mode may hit another surface than its centre.
inline constexpr double kHalfBeam_rad = 0.0015;

/// Reference incidence of SyntheticLidarOptions::incidence_bias_m.
inline constexpr double kSlantRange_m = 10, kSlant_deg = 75;

/// Lidar with its mounting and errors; by default a perfect one, level in the base.
struct SyntheticLidarOptions {
  LidarModel model = velodyne::Model::vlp16;
  velodyne::ReturnMode return_mode = velodyne::ReturnMode::strongest; ///< always strongest for other than Velodynes
  double rpm = 600;
  double first_azimuth_deg = 0; ///< at the start of the trajectory
  Pose T_base_lidar{};
  std::uint16_t port = 2368;                   ///< destination of data packets
  std::uint16_t imu_port = 0;                  ///< destination of an Ouster's inertial readings
  std::uint32_t source_ip = 0xC0A8'01C9;       ///< 192.168.1.201
  double min_range_m = 0.4, max_range_m = 100; ///< no return outside
  double range_noise_m = 0;                    ///< standard deviation; of strong echoes if `fades`
  double dropout = 0;                          ///< share of returns lost, 0..1
  bool fades = false;      ///< far, dark or oblique surfaces give weak echoes: noisier, and lost when too weak
  double dust = 0;         ///< share of pulses that hit a dust grain within a few metres, 0..1
  Duration latency{};      ///< mean network delay; 0: packets arrive after their last firing
  Duration clock_offset{}; ///< clock minus true time
  bool sends_position_packets = false; ///< Velodyne only: one after every fifth data packet
  bool pps_locked = true;              ///< and a valid fix, in its position packets
  double drift = 0;                    ///< rate error of its clock, and of all that it times, positive if fast
  double beam_rad = 0;                 ///< full horizontal divergence, the vertical one is half; 0: a line
  double laser_bias_m = 0;             ///< standard deviation of each laser's constant range error
  double laser_elevation_rad = 0;      ///< same for its elevation, unknown to the decoder
  double incidence_bias_m = 0;         ///< range error at kSlant_deg and kSlantRange_m
  double intensity_bias_m = 0;         ///< range error on black relative to white
  std::vector<Surface> own_parts{};    ///< of the robot, base frame
  std::uint64_t seed = 1;
};

/// Lidar on a moving robot: generates the sensor's datagrams, firing by firing. Every ray starts at the laser's
/// position at its own time, at the rotor's azimuth at that time. One owner.
class SyntheticLidar {
 public:
  /// Scene and trajectory must outlive it. The same arguments give the same bytes. `observed` receives each surface
  /// point that returns an echo.
  SyntheticLidar(const Scene& scene, const Trajectory& trajectory, const SyntheticLidarOptions& options,
                 ObservedSpace* observed = nullptr);

  /// Returns the next data or position packet, sent after its last firing. There is always one: after the course the
  /// robot stands.
  Datagram next();

  [[nodiscard]] const FiringPattern& pattern() const { return pattern_; }

 private:
  struct Aim { ///< of a firing, frame of the lidar, for a column at azimuth 0
    Eigen::Vector3d direction;
    double origin_z_m;
    Duration after;               ///< the column's azimuth
    double bias_m = 0;            ///< of the laser's ranges
    const Surface* met = nullptr; ///< by the ray of the previous column
    bool near_edge = false;       ///< the beam of the previous column was split vertically
  };
  struct Sight { ///< hit of one ray
    Hit hit;
    bool is_own_part = false;
  };
  /// Pose and motion of the lidar and angle of its rotor while one column is fired.
  struct Mount {
    Stamp fired;
    Eigen::Matrix3d R_world_lidar;
    Eigen::Matrix3d R_world_rotor;
    Eigen::Matrix3d R_base_world;
    Eigen::Vector3d position_m;
    Eigen::Vector3d velocity_mps;
    Eigen::Vector3d angular_velocity_radps; ///< world frame, all of them, at the column's instant
  };
  struct Column {
    Mount mount;
    std::vector<std::optional<Sight>> centers; ///< hits of the beam centres
  };
  class Footprint;

  void aim(const SyntheticLidarOptions& options);
  void fire_column(std::size_t column);
  [[nodiscard]] Mount mount_at(Stamp fired) const;
  [[nodiscard]] std::optional<Sight> look(const Mount& mount, const Aim& aim, const Eigen::Vector3d& aimed) const;
  void consider_own_parts(const Mount& mount, const Aim& aim, const Eigen::Vector3d& aimed,
                          std::optional<Sight>& sight) const;
  Echoes fire_line(const Mount& mount, Aim& aim);
  void look_ahead(Stamp own_time);
  Echoes fire_beam(std::size_t index);
  [[nodiscard]] Footprint footprint(std::size_t index);
  [[nodiscard]] bool is_parted_along_turn(std::size_t index) const;
  std::optional<Echo> meet_dust(const Echo& nearest);
  Echo measure(const Aim& aim, const std::optional<Sight>& sight);
  [[nodiscard]] double bias_of_surface_m(const Hit& hit) const;
  Echo measure_dust();
  bool is_lost(double strength);
  [[nodiscard]] Stamp true_time(Stamp own_time) const;
  [[nodiscard]] double rotor_azimuth_rad(Stamp stamp) const;
  [[nodiscard]] Datagram datagram(std::span<const std::byte> payload, std::uint16_t port);
  Stamp arrival();

  const Scene& scene_;
  const Trajectory& trajectory_;
  SyntheticLidarOptions options_;
  std::unique_ptr<PacketWriter> writer_;
  const FiringPattern& pattern_; ///< of the writer
  Pose T_base_rotor_;
  std::vector<Aim> aims_;       ///< of the firings of a column
  Column before_, now_, ahead_; ///< for a beam with divergence
  std::size_t columns_fired_ = 0;
  QuickDice dice_;

  ObservedSpace* observed_;
  Stamp packet_begin_; ///< first column of the next data packet, by the lidar's clock
  Stamp last_arrival_;
  int data_packets_until_position_;
  std::array<std::byte, kPositionPacketBytes> position_{};
};

} // namespace locus::sim
