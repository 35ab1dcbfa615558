// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/sources/axes_check.hpp"
#include "core/sources/health_metric.hpp"

namespace locus {

/// Checks an inertial unit when it starts and when it comes back: its units are those of the contract, gravity points
/// down as configured, and its gyro agrees with lidar.
///
/// A gyro is used at once. Its first turns are compared with lidar's, about each axis of the base separately, since on
/// legged robots the turns of the gait would mask a yaw of the wrong sign. A gyro that disagrees is quarantined,
/// because it would distort the sweeps; lidar without it decides whether it is used again or rejected. While the robot
/// goes straight nothing is proven and nothing is distorted.
///
/// Accelerations in a wrong unit are not used, the gyro still is. A unit that continues to disagree with lidar, or
/// whose axes are not those of its mounting (AxesCheck), is rejected until a restart. verdict() describes the
/// observation in plain words, with possible causes: it is not known which of the two is right, since people who walk
/// around a standing robot mislead lidar. One owner.
class ImuSelfCheck : public HealthMetric {
 public:
  ImuSelfCheck(const Pose& T_base_imu, UseAcceleration use_acceleration);

  std::optional<HealthReason> judge(const SourceReading& reading) override;
  void accept(const SourceReading& reading) override;
  std::optional<HealthReason> on_feedback(LidarOpinion opinion, const RegistrationFeedback& feedback) override;
  void reset() override;

  [[nodiscard]] std::string_view verdict() const override;
  /// Returns false, until gravity has been weighed, if the mean so far cannot be gravity: forces in another unit look
  /// like free fall.
  [[nodiscard]] bool trusts_accelerometer() const override;
  /// Also found of a unit that is rejected.
  [[nodiscard]] std::optional<Eigen::Matrix3d> gyro_axes() const override { return axes_check_.axes(); }

 private:
  /// Observed difference between gyro and lidar.
  enum class Difference : std::uint8_t { any, gyro_still, opposite, degrees };

  /// Integrated angle of the gyro at an instant; lidar's feedback refers to a few sweeps ago.
  struct Turned {
    Stamp stamp;
    Eigen::Vector3d angle_rad; ///< base axes
  };
  /// Turn that lidar has measured, until the gyro's samples cover it for all delays of its stamps.
  struct Seen {
    Stamp from, to;
    Eigen::Vector3d lidar_rad = Eigen::Vector3d::Zero();
  };
  /// Turns about one axis, measured by gyro and lidar.
  struct Turns {
    double lidar_lidar = 0.0, gyro_lidar = 0.0, gyro_gyro = 0.0; ///< sums of products
    int sweeps = 0;

    void add(double gyro_rad, double lidar_rad);
    [[nodiscard]] double likeness() const; ///< cosine
    [[nodiscard]] bool has_scale(double scale) const;
    [[nodiscard]] bool agree() const { return has_scale(1.0); }
    [[nodiscard]] Difference difference() const;
  };

  void weigh(const Eigen::Vector3d& specific_force_base_mps2, Stamp stamp);
  void weigh_gravity();
  [[nodiscard]] bool may_be_gravity() const;
  void follow_turns(const Eigen::Vector3d& turn_rate_base_radps, Stamp stamp);
  [[nodiscard]] const Turned& by_age(std::size_t age) const;
  [[nodiscard]] bool covers(Stamp stamp) const;
  [[nodiscard]] Eigen::Vector3d angle_rad_at(Stamp stamp) const;
  [[nodiscard]] bool is_yet_to_be_used(const RegistrationFeedback& feedback) const;
  void compare_axes(const RegistrationFeedback& feedback);
  void compare_axes(const Seen& seen);
  void compare(const RegistrationFeedback& feedback);
  void review();
  void conclude();
  void refuse(std::string_view verdict);
  [[nodiscard]] std::size_t contradicted_axis(int sweeps) const;
  [[nodiscard]] static std::string_view words(Difference difference, std::size_t axis, bool for_good);

  Eigen::Quaterniond R_base_imu_;
  UseAcceleration use_acceleration_;
  std::string_view verdict_, set_aside_verdict_;
  bool refused_ = false;
  bool trusts_accelerometer_ = true;

  std::optional<Stamp> first_;
  bool weighed_ = false;
  Eigen::Vector3d force_sum_mps2_ = Eigen::Vector3d::Zero(); ///< base axes
  double forces_ = 0.0;

  std::array<Turned, 256> turned_; ///< ring
  std::size_t newest_ = 0, count_ = 0;
  Eigen::Vector3d angle_rad_ = Eigen::Vector3d::Zero();
  std::optional<Stamp> last_;
  bool was_lost_ = false;
  std::optional<Stamp> back_since_; ///< after a loss of health
  std::array<Turns, 3> turns_;      ///< by axis of the base
  bool set_aside_ = false;
  int rounds_ = 0; ///< quarantines without a result
  AxesCheck axes_check_;
  std::array<Seen, 16> seen_; ///< queue
  std::size_t oldest_seen_ = 0, seen_count_ = 0;
};

} // namespace locus
