// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

#include "core/health_metric.hpp"

namespace locus {

/// Start-up check of an inertial unit: are its units those of the contract, does gravity point down where the
/// configuration says that down is, does its gyro turn as lidar sees the robot turn?
///
/// A unit whose accelerations are of another unit is downgraded: they are not used. One whose axes or turn rates are
/// wrong is refused for good. What was found stands in verdict(), in plain words. One owner.
class ImuSelfCheck : public HealthMetric {
 public:
  explicit ImuSelfCheck(const Pose& T_base_imu) : R_base_imu_(T_base_imu.rotation) {}

  std::optional<HealthReason> judge(const SourceReading& reading) override;
  std::optional<HealthReason> hear(LidarOpinion opinion, const RegistrationFeedback& feedback) override;

  [[nodiscard]] std::string_view verdict() const override { return verdict_; }
  [[nodiscard]] bool trusts_accelerometer() const override { return trusts_accelerometer_; }

 private:
  /// How far the gyro had turned when; lidar speaks of what was a few sweeps ago.
  struct Turned {
    Stamp stamp;
    Eigen::Vector3d angle_rad; ///< base axes
  };

  void weigh(const Eigen::Vector3d& specific_force_base_mps2, Stamp stamp);
  void weigh_gravity();
  void follow_turns(const Eigen::Vector3d& turn_rate_base_radps, Stamp stamp);
  [[nodiscard]] const Turned* turned_at(Stamp stamp) const;
  void compare_turns();
  void refuse(std::string_view verdict);

  Eigen::Quaterniond R_base_imu_;
  std::string_view verdict_;
  bool refused_ = false;
  bool trusts_accelerometer_ = true;

  std::optional<Stamp> first_;
  bool weighed_ = false;
  Eigen::Vector3d force_sum_mps2_ = Eigen::Vector3d::Zero(); ///< base axes
  double forces_ = 0.0;

  std::array<Turned, 128> turned_; ///< ring
  std::size_t newest_ = 0, known_ = 0;
  Eigen::Vector3d angle_rad_ = Eigen::Vector3d::Zero();
  std::optional<Stamp> last_;
  double lidar_lidar_ = 0.0, gyro_lidar_ = 0.0, gyro_gyro_ = 0.0; ///< sums of products of turn rates
  int turning_sweeps_ = 0;
};

} // namespace locus
