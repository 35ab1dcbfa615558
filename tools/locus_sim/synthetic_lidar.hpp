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
#include "locus_sim/packet_writer.hpp"
#include "locus_sim/quick_dice.hpp"
#include "locus_sim/scene.hpp"
#include "locus_sim/seen_space.hpp"
#include "locus_sim/trajectory.hpp"

namespace locus::sim {

inline constexpr std::size_t kPositionPacketBytes = 512;

/// In dual return mode the right edge of the beam may meet something else than its centre; it points this far beside
/// it.
inline constexpr double kHalfBeam_rad = 0.0015;

/// What the error of a slanting surface is given for.
inline constexpr double kSlantRange_m = 10, kSlant_deg = 75;

/// A lidar, how it is mounted and what is wrong with it; as it stands, a perfect one that stands level in the base.
struct SyntheticLidarOptions {
  LidarModel model = velodyne::Model::vlp16;
  velodyne::ReturnMode return_mode = velodyne::ReturnMode::strongest; ///< of another than a Velodyne always that
  double rpm = 600;
  double first_azimuth_deg = 0; ///< when the trajectory starts
  Pose T_base_lidar{};
  std::uint16_t port = 2368;                   ///< that data packets are sent to
  std::uint16_t imu_port = 0;                  ///< of an Ouster, that readings of its inertial unit are sent to
  std::uint32_t source_ip = 0xC0A8'01C9;       ///< 192.168.1.201
  double min_range_m = 0.4, max_range_m = 100; ///< no return beyond
  double range_noise_m = 0;                    ///< standard deviation, of strong echoes where they fade
  double dropout = 0;                          ///< share of the returns that is lost, 0..1
  bool fades = false;      ///< echoes of far, dark or slanting surfaces are weak: noisier, and lost when too weak
  double dust = 0;         ///< share of the pulses that meet a grain of dust within a few metres, 0..1
  Duration latency{};      ///< mean of what the network takes; 0: packets arrive when their last firing is over
  Duration clock_offset{}; ///< what its clock is ahead of true time
  bool sends_position_packets = false; ///< of a Velodyne: one after every fifth data packet
  bool pps_locked = true;              ///< and a valid fix, in its position packets
  double drift = 0;                    ///< share by which its clock, and all that the clock times, runs fast
  double beam_rad = 0;                 ///< full divergence along the turn, across it half as much; 0: a line
  double laser_bias_m = 0;             ///< standard deviation of a constant error of each laser's ranges
  double laser_elevation_rad = 0;      ///< the same of its elevation; the decoder believes the table
  double incidence_bias_m = 0;         ///< what is met at kSlant_deg and kSlantRange_m seems farther by this
  double intensity_bias_m = 0;         ///< black seems farther than white by this
  std::vector<Surface> own_parts{};    ///< of the robot, base frame
  std::uint64_t seed = 1;
};

/// By a Velodyne's clock that shows this. 0 <= it < 1 h.
std::uint32_t microseconds_past_hour(Stamp shown);

/// A lidar on a moving robot: makes the datagrams that the sensor would send, firing by firing. Every ray leaves from
/// where the laser is at its own time, under the azimuth that the rotor has at that time. One owner.
class SyntheticLidar {
 public:
  /// Scene and trajectory must outlive it. The same arguments give the same bytes.
  /// `seen` takes note of every surface point that an echo comes from.
  SyntheticLidar(const Scene& scene, const Trajectory& trajectory, const SyntheticLidarOptions& options,
                 SeenSpace* seen = nullptr);

  /// The next data or position packet, sent when its last firing is over. There is always one: when the course ends the
  /// robot stands.
  Datagram next();

  [[nodiscard]] const FiringPattern& pattern() const { return pattern_; }

 private:
  struct Aim { ///< of a firing, in the frame of the lidar, as if its column had azimuth 0
    Eigen::Vector3d direction;
    double origin_z_m;
    Duration after;               ///< the instant of the column
    double bias_m = 0;            ///< of its laser's ranges
    const Surface* met = nullptr; ///< by the ray of the column before
    bool near_edge = false;       ///< the beam of the column before was parted from top to bottom
  };
  struct Sight { ///< of one ray
    Hit hit;
    bool is_own_part = false;
  };
  /// Where the lidar is, how it moves and how far its rotor has turned while one column is fired.
  struct Mount {
    Stamp fired;
    Eigen::Matrix3d R_world_lidar;
    Eigen::Matrix3d R_world_rotor;
    Eigen::Matrix3d R_base_world;
    Eigen::Vector3d position_m;
    Eigen::Vector3d velocity_mps;
    Eigen::Vector3d angular_velocity_radps; ///< all in world frame, at the instant of the column
  };
  struct Column {
    Mount mount;
    std::vector<std::optional<Sight>> centers; ///< what the middle of each beam meets
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
  void fill_position_packet();
  [[nodiscard]] Datagram datagram(std::span<const std::byte> payload, std::uint16_t port);
  Stamp arrival();

  const Scene& scene_;
  const Trajectory& trajectory_;
  SyntheticLidarOptions options_;
  std::unique_ptr<PacketWriter> writer_;
  const FiringPattern& pattern_; ///< of the writer
  Pose T_base_rotor_;
  std::vector<Aim> aims_;       ///< of the firings of a column
  Column before_, now_, ahead_; ///< of a beam that is no line
  std::size_t columns_fired_ = 0;
  QuickDice dice_;

  SeenSpace* seen_;
  Stamp packet_begin_; ///< first column of the data packet to come, by the lidar's clock
  Stamp last_arrival_;
  int data_packets_until_position_;
  std::array<std::byte, kPositionPacketBytes> position_{};
};

} // namespace locus::sim
