// SPDX-License-Identifier: Apache-2.0
#include "core/odometry/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include "core/sources/motion_sample.hpp"

namespace locus {
namespace {

constexpr SourceId kWheelSource{0}, kGyroSource{1};
constexpr int kX = 0, kYaw = 5;
constexpr std::array kRates_hz{5.0, 10.0, 20.0};
constexpr double kLearned = 1.5 * 1.5; ///< a variance is within that factor
constexpr double kSigmas = 4.0;        ///< a Gaussian is farther off once in 16 000

constexpr MotionFilter::Measured kNothing{.translation = false, .rotation = false};
constexpr MotionFilter::Measured kTranslation{.translation = true, .rotation = false};
constexpr MotionFilter::Measured kRotation{.translation = false, .rotation = true};
constexpr MotionFilter::Measured kAll{.translation = true, .rotation = true};

/// What the filter takes sources to be like before it knows them: way and turn after a second.
const Vector6 kUsualWheels = along_each_axis(0.02, 0.01 / kRadPerDeg);
const Vector6 kUsualGyro = along_each_axis(0.0, 0.006 / kRadPerDeg);

std::vector<MotionSourceOptions> wheels_and_gyro() {
  return {{.name = "wheels", .kind = SourceKind::odometry, .T_base_source = {}},
          {.name = "gyro", .kind = SourceKind::imu, .T_base_source = {}}};
}

Vector6 twist_of(double vx, double vy, double vz, double wx, double wy, double wz) {
  return (Vector6() << vx, vy, vz, wx, wy, wz).finished();
}

using Motion = std::function<Vector6(double t_s)>; ///< twist of the base, base axes

Motion straight(double speed_mps) {
  return [=](double) { return twist_of(speed_mps, 0, 0, 0, 0, 0); };
}

Vector6 winding(double t) {
  return twist_of(1.5 + 0.5 * std::sin(0.7 * t), 0.05 * std::sin(1.3 * t), 0.03 * std::sin(1.1 * t),
                  0.05 * std::sin(2.0 * t), 0.05 * std::sin(1.7 * t), 0.3 * std::sin(0.5 * t));
}

/// So slow that no error in proportion to the motion matters.
Vector6 creeping(double t) { return 0.1 * winding(t); }

/// A robot that truly moves like that. Its sensors err by nothing but Gaussian noise, bias and scale.
class Robot {
 public:
  struct Sensors {
    Vector6 wheels = kUsualWheels, gyro = kUsualGyro; ///< standard deviation of way and turn after a second
    double scale = 0.0;                               ///< of the way ahead
    double to_the_left = 0.0, upwards = 0.0;          ///< of the way ahead, too
    Eigen::Vector3d bias_radps = Eigen::Vector3d::Zero();
    double force_mps = 0.02; ///< of the speed after a second
    Eigen::Vector3d force_bias_mps2 = Eigen::Vector3d::Zero();
  };

  Robot(Motion motion, Sensors sensors, unsigned seed)
      : motion_(std::move(motion)), sensors_(std::move(sensors)), random_(seed) {}

  void move(double elapsed_s) {
    constexpr int kParts = 40;
    const Pose T_odom_last = T_odom_base_;
    const double part_s = elapsed_s / kParts;
    elapsed_s_ = elapsed_s;
    force_.setZero();
    for (int i = 0; i < kParts; ++i) {
      const double t = t_s_ + (i + 0.5) * part_s;
      const Vector6 twist = motion_(t);
      const Vector6 rate = (motion_(t + 0.5 * part_s) - motion_(t - 0.5 * part_s)) / part_s;
      const Eigen::Quaterniond R_odom_base = T_odom_base_.rotation * so3_exp(0.5 * part_s * twist.tail<3>());
      const Eigen::Vector3d inertial = rate.head<3>() + twist.tail<3>().cross(twist.head<3>());
      force_ += (inertial + R_odom_base.conjugate() * (kGravity_mps2 * Eigen::Vector3d::UnitZ())) / kParts;
      T_odom_base_ = T_odom_base_ * se3_exp(part_s * twist);
    }
    t_s_ += elapsed_s;
    twist_ = se3_log(T_odom_last.inverse() * T_odom_base_) / elapsed_s;
  }

  [[nodiscard]] const Pose& pose() const { return T_odom_base_; }
  [[nodiscard]] const Vector6& twist() const { return twist_; } ///< mean since the last
  [[nodiscard]] double t_s() const { return t_s_; }

  Vector6 wheels() {
    Vector6 said = noisy(twist_, sensors_.wheels / std::sqrt(elapsed_s_));
    said.head<3>() += twist_[kX] * Eigen::Vector3d{sensors_.scale, sensors_.to_the_left, sensors_.upwards};
    return said;
  }
  Vector6 gyro() {
    Vector6 said = noisy(twist_, sensors_.gyro / std::sqrt(elapsed_s_));
    said.head<3>().setZero();
    said.tail<3>() += sensors_.bias_radps;
    return said;
  }
  SpecificForce force() {
    const Vector6 sigma = along_each_axis(sensors_.force_mps, 0.0) / std::sqrt(elapsed_s_);
    const Eigen::Vector3d mean = force_ + sensors_.force_bias_mps2 + noisy(Vector6::Zero(), sigma).head<3>();
    return {mean, mean};
  }
  /// The truth with the noise of what lidar knows.
  Vector12 seen_beside(const MotionBelief& belief, const Matrix12& information) {
    Vector12 off;
    off << difference(T_odom_base_, belief.T_target_source), twist_ - belief.twist_base;
    for (int i = 0; i < 12; ++i)
      off[i] += information(i, i) > 0.0 ? normal_(random_) / std::sqrt(information(i, i)) : 0.0;
    return off;
  }

 private:
  Vector6 noisy(Vector6 value, const Vector6& sigma) {
    for (int i = 0; i < 6; ++i)
      value[i] += sigma[i] * normal_(random_);
    return value;
  }

  Motion motion_;
  Sensors sensors_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  Pose T_odom_base_;
  Vector6 twist_ = Vector6::Zero();
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();
  double t_s_ = 0.0, elapsed_s_ = 0.0;
};

/// Of a lidar that knows pose and twist of its sweeps so well along each axis.
Matrix12 lidar_with(const Vector6& pose_sigma, const Vector6& twist_sigma) {
  Vector12 sigma;
  sigma << pose_sigma, twist_sigma;
  return sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}
/// The points of one sweep place it to 5 mm and 1 mrad, and their spread of ages tells the twist to three times that in
/// the time of the sweep.
Matrix12 usual_lidar(double period_s) {
  const Vector6 pose = along_each_axis(0.005, 0.001 / kRadPerDeg);
  return lidar_with(pose, 3.0 / period_s * pose);
}
Matrix12 blind_ahead(Matrix12 information) {
  for (const int axis : {kX, 6 + kX}) {
    information.row(axis).setZero();
    information.col(axis).setZero();
  }
  return information;
}

/// As a registration does: the belief and what the points say, by their information.
void see(MotionFilter& filter, Robot& robot, const Matrix12& information) {
  const MotionBelief belief = filter.belief();
  const Vector12 off = robot.seen_beside(belief, information);
  const Vector12 step = (belief.information + information).ldlt().solve(information * off);
  const Eigen::Vector3d turn = step.segment<3>(3);
  filter.see({(so3_exp(turn) * belief.T_target_source.rotation).normalized(),
              belief.T_target_source.translation + step.head<3>()},
             belief.twist_base + step.tail<6>(), information);
}

struct Sensing {
  bool wheels = true, gyro = true, force = false;
  std::optional<Matrix12> lidar = std::nullopt;
};

/// One sweep.
void sweep(MotionFilter& filter, Robot& robot, double elapsed_s, const Sensing& sensing) {
  robot.move(elapsed_s);
  filter.predict(elapsed_s, elapsed_s, sensing.force ? std::optional(robot.force()) : std::nullopt,
                 {.translation = sensing.wheels, .rotation = sensing.wheels || sensing.gyro});
  if (sensing.gyro)
    filter.measure(kGyroSource, robot.gyro(), kRotation);
  if (sensing.wheels)
    filter.measure(kWheelSource, robot.wheels(), sensing.gyro ? kTranslation : kAll);
  filter.move();
  if (sensing.lidar)
    see(filter, robot, *sensing.lidar);
  filter.learn();
}

void sweep_for(double time_s, MotionFilter& filter, Robot& robot, double elapsed_s, const Sensing& sensing) {
  const auto count = static_cast<int>(std::lround(time_s / elapsed_s));
  for (int i = 0; i < count; ++i)
    sweep(filter, robot, elapsed_s, sensing);
}

MotionFilter begun(const Vector6& twist, const Vector6& sigma = along_each_axis(0.05, 1.0)) {
  MotionFilter filter(wheels_and_gyro());
  filter.begin(Pose{}, twist, sigma);
  return filter;
}
MotionFilter begun_with(const Robot& robot, const Motion& motion) { return begun(motion(robot.t_s())); }

Vector12 error_of(const MotionFilter& filter, const Robot& robot) {
  Vector12 error;
  error << difference(robot.pose(), filter.pose()), robot.twist() - filter.twist_base();
  return error;
}

/// Normalised estimation error squared, for each dimension.
double nees(const MotionFilter& filter, const Robot& robot) {
  const Vector12 error = error_of(filter, robot);
  return error.dot(filter.covariance().ldlt().solve(error)) / 12.0;
}

double sigma_of(const MotionFilter& filter, int axis) { return std::sqrt(filter.covariance()(axis, axis)); }

/// What of an innovation's variance is the source's own noise: variance of the way or turn after a second.
Vector6 noise_of(const MotionFilter& filter, SourceId source, const Vector6& said, double elapsed_s) {
  const Innovation found = filter.innovation(source, said);
  return (found.variance - found.others - found.known) * elapsed_s;
}

bool is_sound(const Matrix12& covariance) {
  const double most = std::max(1.0, covariance.cwiseAbs().maxCoeff());
  return covariance.allFinite() && (covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-12 * most &&
         Eigen::SelfAdjointEigenSolver<Matrix12>(covariance).eigenvalues()[0] > -1e-9;
}

// --- Consistency ------------------------------------------------------------------------------------------------

/// Means over drives of 20 s. With white noise alone those of 2000 sweeps or more would lie within a few percent of
/// one; the rest is for what the filter allows for and this robot does not do.
double mean_nees(double rate_hz, Sensing sensing) {
  sensing.lidar = usual_lidar(1.0 / rate_hz);
  double sum = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Robot robot(winding, {}, seed);
    MotionFilter filter = begun_with(robot, winding);
    for (int i = 0; i < static_cast<int>(20 * rate_hz); ++i) {
      sweep(filter, robot, 1.0 / rate_hz, sensing);
      sum += nees(filter, robot);
      ++count;
    }
  }
  return sum / count;
}

void expect_consistent(const Sensing& sensing) {
  for (const double rate_hz : kRates_hz) {
    const double mean = mean_nees(rate_hz, sensing);
    EXPECT_GT(mean, 0.6) << rate_hz << " Hz";
    EXPECT_LT(mean, 1.5) << rate_hz << " Hz";
  }
}

TEST(MotionFilter, IsAsSureAsItIsRightWithLidarAlone) { expect_consistent({.wheels = false, .gyro = false}); }
TEST(MotionFilter, IsAsSureAsItIsRightWithGyro) { expect_consistent({.wheels = false}); }
TEST(MotionFilter, IsAsSureAsItIsRightWithWheels) { expect_consistent({.gyro = false}); }
TEST(MotionFilter, IsAsSureAsItIsRightWithWheelsAndGyro) { expect_consistent({}); }
TEST(MotionFilter, IsAsSureAsItIsRightWithAccelerometerAndGyro) { expect_consistent({.wheels = false, .force = true}); }
TEST(MotionFilter, IsAsSureAsItIsRightWithAllSensors) { expect_consistent({.force = true}); }

// --- What it finds out about the sensors --------------------------------------------------------------------------

/// The turn that lidar sees in so long tells the bias as well as the gyro's own noise lets it.
TEST(MotionFilter, FindsTheBiasOfAGyro) {
  constexpr double kTime_s = 60.0;
  const Eigen::Vector3d bias{0.01, -0.015, 0.02};
  for (const double rate_hz : kRates_hz) {
    Robot robot(winding, {.bias_radps = bias}, 1);
    MotionFilter filter = begun_with(robot, winding);
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.wheels = false, .lidar = usual_lidar(1.0 / rate_hz)});
    const Eigen::Vector3d found = filter.state().segment<3>(filter.state_of(kGyroSource));
    EXPECT_LT((found - bias).cwiseAbs().maxCoeff(), kSigmas * kUsualGyro[kYaw] / std::sqrt(kTime_s))
        << rate_hz << " Hz";
  }
}

TEST(MotionFilter, FindsTheScaleOfWheelsWhereLidarSeesAllAxes) {
  constexpr double kTime_s = 60.0, kSpeed_mps = 1.5, kScale = 0.04;
  for (const double rate_hz : kRates_hz) {
    Robot robot(straight(kSpeed_mps), {.scale = kScale}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.lidar = usual_lidar(1.0 / rate_hz)});
    const double way_sigma = kUsualWheels[kX] * std::sqrt(kTime_s);
    EXPECT_NEAR(filter.state()[filter.state_of(kWheelSource)], kScale, kSigmas * way_sigma / (kSpeed_mps * kTime_s))
        << rate_hz << " Hz";
  }
}

/// As on a robot whose odometry is half a degree askew: what carries it on where lidar is gone is the way it goes.
TEST(MotionFilter, FindsWhereAnOdometryGoesWhenItGoesAhead) {
  constexpr double kTime_s = 60.0, kSpeed_mps = 1.5, kToTheLeft = 0.015, kUpwards = -0.01;
  for (const double rate_hz : kRates_hz) {
    Robot robot(straight(kSpeed_mps), {.to_the_left = kToTheLeft, .upwards = kUpwards}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, {.lidar = usual_lidar(1.0 / rate_hz)});
    const Eigen::Vector2d found = filter.state().segment<2>(filter.state_of(kWheelSource) + 2);
    const double sigma = kUsualWheels[kX] * std::sqrt(kTime_s) / (kSpeed_mps * kTime_s);
    EXPECT_NEAR(found.x(), kToTheLeft, kSigmas * sigma) << rate_hz << " Hz";
    EXPECT_NEAR(found.y(), kUpwards, kSigmas * sigma) << rate_hz << " Hz";
  }
}

/// Mean over half a minute of the noise that it has learned, in units of the true one. Lidar is better than the source.
Vector6 learned_noise(double rate_hz, SourceId source, const Robot::Sensors& sensors) {
  const double elapsed_s = 1.0 / rate_hz;
  const Vector6 sharp = along_each_axis(0.001, 0.0002 / kRadPerDeg);
  const bool gyro = source == kGyroSource;
  const Sensing sensing{.wheels = !gyro, .gyro = gyro, .lidar = lidar_with(sharp, 3.0 / elapsed_s * sharp)};
  Robot robot(creeping, sensors, 1);
  MotionFilter filter = begun_with(robot, creeping);
  sweep_for(60.0, filter, robot, elapsed_s, sensing);
  Vector6 sum = Vector6::Zero();
  const auto count = static_cast<int>(30 * rate_hz);
  for (int i = 0; i < count; ++i) {
    sweep(filter, robot, elapsed_s, sensing);
    sum += noise_of(filter, source, robot.twist(), elapsed_s) / count;
  }
  const Vector6 truth = (gyro ? sensors.gyro : sensors.wheels).cwiseAbs2();
  return (truth.array() > 0.0).select(sum.array() / truth.array(), 1.0);
}

void expect_learned(SourceId source, const Robot::Sensors& sensors) {
  for (const double rate_hz : kRates_hz) {
    const Vector6 found = learned_noise(rate_hz, source, sensors);
    for (int axis = 0; axis < 6; ++axis) {
      EXPECT_LT(found[axis], kLearned) << rate_hz << " Hz, axis " << axis;
      EXPECT_GT(found[axis], 1.0 / kLearned) << rate_hz << " Hz, axis " << axis;
    }
  }
}

// The floors are 6 mm, 1 mrad for odometry, 1 mrad for a gyro.
TEST(MotionFilter, LearnsHowBadWheelsAre) { expect_learned(kWheelSource, {.wheels = 10.0 * kUsualWheels}); }
TEST(MotionFilter, LearnsHowGoodWheelsAre) {
  expect_learned(kWheelSource, {.wheels = along_each_axis(0.006, 0.001 / kRadPerDeg)});
}
TEST(MotionFilter, LearnsHowBadAGyroIs) { expect_learned(kGyroSource, {.gyro = 10.0 * kUsualGyro}); }
TEST(MotionFilter, LearnsHowGoodAGyroIs) {
  expect_learned(kGyroSource, {.gyro = along_each_axis(0.0, 0.001 / kRadPerDeg)});
}

/// Two sources of the usual noise, of which nothing else tells how noisy they are: neither is better or worse known
/// than before.
TEST(MotionFilter, LearnsNothingOfASourceThatNothingElseCanJudge) {
  for (const double rate_hz : kRates_hz) {
    const double elapsed_s = 1.0 / rate_hz;
    for (const bool gyro : {false, true}) {
      Robot robot(straight(1.0), {}, 1);
      MotionFilter filter = begun_with(robot, straight(1.0));
      sweep_for(300.0, filter, robot, elapsed_s, {.wheels = !gyro, .gyro = gyro});
      const Vector6 noise = noise_of(filter, gyro ? kGyroSource : kWheelSource, robot.twist(), elapsed_s);
      const Vector6 usual = (gyro ? kUsualGyro : kUsualWheels).cwiseAbs2();
      for (int axis = gyro ? 3 : 0; axis < 6; ++axis) {
        EXPECT_GT(noise[axis] / usual[axis], 1.0 / kLearned) << rate_hz << " Hz, gyro " << gyro << ", axis " << axis;
        EXPECT_LT(noise[axis] / usual[axis], kLearned) << rate_hz << " Hz, gyro " << gyro << ", axis " << axis;
      }
    }
  }
}

TEST(MotionFilter, LearnsNothingOfWheelsAlongAnAxisThatLidarDoesNotSee) {
  for (const double rate_hz : kRates_hz) {
    const double elapsed_s = 1.0 / rate_hz;
    Robot robot(straight(1.0), {}, 1);
    MotionFilter filter = begun_with(robot, straight(1.0));
    sweep_for(300.0, filter, robot, elapsed_s, {.lidar = blind_ahead(usual_lidar(elapsed_s))});
    const double noise =
        noise_of(filter, kWheelSource, robot.twist(), elapsed_s)[kX] / (kUsualWheels[kX] * kUsualWheels[kX]);
    EXPECT_GT(noise, 1.0 / kLearned) << rate_hz << " Hz";
    EXPECT_LT(noise, kLearned) << rate_hz << " Hz";
  }
}

TEST(MotionFilter, ForgetsBiasScaleAndNoiseOfASourceThatMayComeBackAsAnother) {
  Robot robot(straight(1.5),
              {.wheels = 5.0 * kUsualWheels, .gyro = 5.0 * kUsualGyro, .scale = 0.04, .bias_radps = {0.01, 0.01, 0.01}},
              1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  sweep_for(30.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
  ASSERT_GT(noise_of(filter, kWheelSource, robot.twist(), 0.1)[kX], 5.0 * kUsualWheels[kX] * kUsualWheels[kX]);
  const Matrix12 before = filter.covariance();
  const Eigen::Vector3d bias = filter.state().segment<3>(filter.state_of(kGyroSource));
  filter.forget(kWheelSource);
  EXPECT_EQ(filter.state().segment<2>(filter.state_of(kWheelSource)), Eigen::Vector2d::Zero());
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), bias) << "another one";
  filter.forget(kGyroSource);
  EXPECT_EQ(filter.state().segment<3>(filter.state_of(kGyroSource)), Eigen::Vector3d::Zero());
  EXPECT_EQ(filter.covariance(), before) << "where the robot is is as well known";
  filter.predict(0.1, 0.1, std::nullopt, kNothing);
  filter.move();
  for (const auto& [source, usual, first] :
       {std::tuple(kWheelSource, kUsualWheels, 0), std::tuple(kGyroSource, kUsualGyro, 3)})
    for (int axis = first; axis < 6; ++axis)
      EXPECT_NEAR(noise_of(filter, source, robot.twist(), 0.1)[axis], usual[axis] * usual[axis], 1e-12) << axis;
}

// --- Where it is not told -----------------------------------------------------------------------------------------

/// What wheels say ahead is all that is known: their scale must not follow from it.
TEST(MotionFilter, WheelsInATunnelKeepTheirScale) {
  constexpr double kSpeed_mps = 1.5, kTime_s = 300.0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Robot robot(straight(kSpeed_mps), {}, seed);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    sweep_for(kTime_s, filter, robot, 0.1, {.lidar = blind_ahead(usual_lidar(0.1))});
    const double off_m = std::abs(error_of(filter, robot)[kX]);
    EXPECT_LT(off_m, 0.03 * kSpeed_mps * kTime_s) << "scale " << filter.state()[filter.state_of(kWheelSource)];
    EXPECT_LT(off_m, kSigmas * std::sqrt(filter.pose_covariance_since_start()(kX, kX)));
  }
}

TEST(MotionFilter, WheelsOfSomeScaleInATunnelAreWithinTheirDoubt) {
  constexpr double kSpeed_mps = 1.5, kTime_s = 300.0;
  Robot robot(straight(kSpeed_mps), {.scale = 0.05}, 1);
  MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
  sweep_for(kTime_s, filter, robot, 0.1, {.lidar = blind_ahead(usual_lidar(0.1))});
  EXPECT_LT(std::abs(error_of(filter, robot)[kX]), kSigmas * std::sqrt(filter.pose_covariance_since_start()(kX, kX)));
}

Vector6 speeding_up_from_the_fifth_second(double t) {
  return twist_of(1.0 + std::clamp(t - 5.0, 0.0, 5.0), 0, 0, 0, 0, 0);
}

/// The sweeps of five seconds were lost while the robot sped up from 1 to 6 m/s; the force is that of the last sweep.
class Gap {
 public:
  static constexpr double kGap_s = 5.0, kPeriod_s = 0.1;

  explicit Gap(const Sensing& sensing)
      : sensing_(sensing), robot_(speeding_up_from_the_fifth_second, {}, 1),
        filter_(begun_with(robot_, speeding_up_from_the_fifth_second)) {
    Sensing seen = sensing;
    seen.lidar = usual_lidar(kPeriod_s);
    sweep_for(5.0, filter_, robot_, kPeriod_s, seen);
    step(kGap_s);
  }

  void step(double elapsed_s) {
    robot_.move(elapsed_s);
    filter_.predict(elapsed_s, kPeriod_s, sensing_.force ? std::optional(robot_.force()) : std::nullopt,
                    {.translation = sensing_.wheels, .rotation = sensing_.wheels});
    if (sensing_.wheels)
      filter_.measure(kWheelSource, robot_.wheels(), kAll);
    filter_.move();
  }
  void look() { see(filter_, robot_, usual_lidar(kPeriod_s)); }
  void expect_covered(const char* when) const {
    const Vector12 error = error_of(filter_, robot_);
    for (int axis = 0; axis < 12; ++axis)
      EXPECT_LT(std::abs(error[axis]), kSigmas * sigma_of(filter_, axis)) << when << ", axis " << axis;
  }

 private:
  Sensing sensing_;
  Robot robot_;
  MotionFilter filter_;
};

const std::vector<std::pair<const char*, Sensing>> kInAGap{{"nothing", {.wheels = false, .gyro = false}},
                                                           {"force", {.wheels = false, .gyro = false, .force = true}},
                                                           {"wheels", {.wheels = true, .gyro = false}}};

TEST(MotionFilter, IsHonestAfterAGapInWhichItSpedUp) {
  for (const auto& [what, sensing] : kInAGap)
    Gap(sensing).expect_covered(what);
}

TEST(MotionFilter, IsHonestWhenItIsSeenAfterAGap) {
  for (const auto& [what, sensing] : kInAGap) {
    Gap gap(sensing);
    gap.look();
    gap.expect_covered(what);
  }
}

TEST(MotionFilter, IsHonestInTheSweepThatFollowsAGap) {
  for (const auto& [what, sensing] : kInAGap) {
    Gap gap(sensing);
    gap.look();
    gap.step(Gap::kPeriod_s);
    gap.expect_covered(what);
  }
}

/// Nobody tells whether it stopped at once or went on as it did: it may have done either.
TEST(MotionFilter, ARobotThatIsNotSeenComesToRestAndMayAsWellHaveGoneOn) {
  constexpr double kSpeed_mps = 1.0, kTime_s = 3.0;
  for (const double rate_hz : kRates_hz) {
    Robot robot(straight(kSpeed_mps), {}, 1);
    MotionFilter filter = begun_with(robot, straight(kSpeed_mps));
    const Sensing unseen{.wheels = false, .gyro = false};
    Sensing seen = unseen;
    seen.lidar = usual_lidar(1.0 / rate_hz);
    sweep_for(5.0, filter, robot, 1.0 / rate_hz, seen);
    const double begin_m = robot.pose().translation.x();
    sweep_for(kTime_s, filter, robot, 1.0 / rate_hz, unseen);
    EXPECT_LT(filter.twist_base().head<3>().norm(), kSpeed_mps / 20) << rate_hz << " Hz";
    for (const double way_m : {0.0, kSpeed_mps * kTime_s})
      EXPECT_LT(std::abs(filter.pose().translation.x() - begin_m - way_m), kSigmas * sigma_of(filter, kX))
          << rate_hz << " Hz, " << way_m << " m";
    for (const double speed_mps : {0.0, kSpeed_mps})
      EXPECT_LT(std::abs(filter.twist_base()[kX] - speed_mps), kSigmas * sigma_of(filter, 6 + kX))
          << rate_hz << " Hz, " << speed_mps << " m/s";
  }
}

TEST(MotionFilter, ARobotThatStandsHasNoTwist) {
  MotionFilter filter = begun(twist_of(0.3, 0.1, -0.1, 0.1, -0.1, 0.2), along_each_axis(0.5, 20.0));
  filter.predict(0.1, 0.1, std::nullopt, kNothing);
  filter.rest();
  filter.move();
  for (int axis = 0; axis < 6; ++axis) {
    EXPECT_LT(std::abs(filter.twist_base()[axis]), 1e-4) << axis;
    EXPECT_LT(sigma_of(filter, 6 + axis), 1.1e-3) << axis;
  }
}

// --- What it says of sources --------------------------------------------------------------------------------------

/// Squared innovation over its variance, mean over the second half of 20 drives of 20 s. What is not measured all the
/// time is in the first half, so that its bias is known.
Vector6 mean_ratio(double rate_hz, SourceId source, bool all_the_time) {
  Vector6 sum = Vector6::Zero();
  int count = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Robot robot(creeping, {}, seed);
    MotionFilter filter = begun_with(robot, creeping);
    const double elapsed_s = 1.0 / rate_hz;
    for (int i = 0; i < static_cast<int>(20 * rate_hz); ++i) {
      const bool counts = i >= static_cast<int>(10 * rate_hz), measured = all_the_time || !counts;
      robot.move(elapsed_s);
      filter.predict(elapsed_s, elapsed_s, std::nullopt, measured ? kAll : kNothing);
      const Vector6 said = source == kGyroSource ? robot.gyro() : robot.wheels();
      if (measured)
        filter.measure(source, said, source == kGyroSource ? kRotation : kAll);
      filter.move();
      see(filter, robot, usual_lidar(elapsed_s));
      if (counts) {
        const Innovation found = filter.innovation(source, said);
        sum +=
            (found.variance.array() > 0.0).select(found.value.array().square() / found.variance.array(), 1.0).matrix();
        ++count;
      }
      filter.learn();
    }
  }
  return sum / count;
}

TEST(MotionFilter, AnHonestSourceIsAsFarOffAsItMayBe) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, true);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, AnHonestSourceThatIsNotUsedIsAsFarOffAsItMayBe) {
  for (const double rate_hz : kRates_hz)
    for (const SourceId source : {kWheelSource, kGyroSource}) {
      const Vector6 mean = mean_ratio(rate_hz, source, false);
      for (int axis = 0; axis < 6; ++axis) {
        EXPECT_GT(mean[axis], 0.7) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
        EXPECT_LT(mean[axis], 1.4) << rate_hz << " Hz, source " << index_of(source) << ", axis " << axis;
      }
    }
}

TEST(MotionFilter, WheelsThatAreOffByAMetreEachSecondAreFoundOut) {
  for (const double rate_hz : kRates_hz)
    for (const bool measured : {false, true}) {
      const double elapsed_s = 1.0 / rate_hz;
      Robot robot(straight(1.0), {}, 1);
      MotionFilter filter = begun_with(robot, straight(1.0));
      sweep_for(20.0, filter, robot, elapsed_s, {.lidar = usual_lidar(elapsed_s)});
      robot.move(elapsed_s);
      filter.predict(elapsed_s, elapsed_s, std::nullopt, measured ? kAll : kNothing);
      Vector6 said = robot.wheels();
      said[kX] += 1.0;
      if (measured)
        filter.measure(kWheelSource, said, kAll);
      filter.move();
      see(filter, robot, usual_lidar(elapsed_s));
      const Innovation found = filter.innovation(kWheelSource, said);
      EXPECT_GT(found.value[kX] * found.value[kX] / found.variance[kX], 16.0)
          << rate_hz << " Hz, measured " << measured;
    }
}

// --- The map ------------------------------------------------------------------------------------------------------

/// What the map takes over of the pose's error is no longer the pose's against the map: since the start it is the same.
TEST(MotionFilter, WhatTheMapTakesOverIsNotLostSinceTheStart) {
  for (const double share : {0.0, 0.1, 0.5, 1.0}) {
    MotionFilter filter = begun(twist_of(1, 0, 0, 0, 0, 0.2));
    Robot robot(straight(1.0), {}, 1);
    sweep_for(1.0, filter, robot, 0.1, {}); // unseen: far above the floor of the pose
    const Matrix6 before = filter.pose_covariance_since_start();
    const double against_map = filter.covariance()(kX, kX);
    filter.keep(share * Matrix6::Identity());
    const Matrix6 after = filter.pose_covariance_since_start();
    const Vector6 floor = along_each_axis(0.001, 1e-4 / kRadPerDeg).cwiseAbs2(); // surfaces are no better known
    for (int axis = 0; axis < 6; ++axis)
      EXPECT_NEAR(after(axis, axis), before(axis, axis), 1e-9 + floor[axis]) << share << ", axis " << axis;
    EXPECT_NEAR(filter.covariance()(kX, kX), std::max(floor[kX], (1 - share) * (1 - share) * against_map), 1e-9);
  }
}

TEST(MotionFilter, SinceTheStartItIsNeverSurerThanAgainstTheMap) {
  Robot robot(straight(1.5), {}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  double last = 0.0;
  for (int keyframe = 0; keyframe < 50; ++keyframe) {
    sweep_for(1.0, filter, robot, 0.1, {.lidar = usual_lidar(0.1)});
    filter.keep(0.2 * Matrix6::Identity());
    const Matrix6 more = filter.pose_covariance_since_start() - filter.covariance().topLeftCorner<6, 6>();
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(more).eigenvalues()[0], -1e-9);
    EXPECT_GT(more(kX, kX), last) << "the map drifts";
    last = more(kX, kX);
  }
}

/// Two milliradians and five millimetres.
TEST(MotionFilter, ALidarThatSitsOtherwiseThanThoughtSeesTheWayOfAnotherBody) {
  MotionFilter filter = begun(Vector6::Zero());
  const Matrix6 at_start = filter.pose_covariance_since_start();
  const auto sigma_at = [&](const Pose& pose) {
    filter.put(pose);
    return (filter.pose_covariance_since_start() - at_start).diagonal().cwiseMax(0.0).cwiseSqrt().eval();
  };
  EXPECT_TRUE(sigma_at(Pose{}).isZero(1e-9));
  const Vector6 straight_on = sigma_at({Eigen::Quaterniond::Identity(), {10, 0, 0}});
  EXPECT_TRUE(straight_on.isApprox(twist_of(0, 0.02, 0.02, 0, 0, 0), 1e-6)) << straight_on.transpose();
  const Vector6 turned_round = sigma_at({so3_exp({0, 0, 180 * kRadPerDeg}), {0, 0, 0}});
  EXPECT_TRUE(turned_round.isApprox(twist_of(0.01, 0.01, 0, 0.004, 0.004, 0), 1e-6)) << turned_round.transpose();
}

// --- What the robot is able to -------------------------------------------------------------------------------------

/// What it is taken to drive a moment after it drove 14 m/s, known as well as that.
double speed_after_a_move(const MotionLimits& limits, double sigma_mps) {
  MotionFilter filter(wheels_and_gyro(), limits);
  filter.begin(Pose{}, twist_of(14, 0, 0, 0, 0, 0), along_each_axis(sigma_mps, 1.0));
  filter.predict(1e-3, 1e-3, std::nullopt, kNothing);
  filter.move();
  return filter.twist_base().head<3>().norm();
}

TEST(MotionFilter, AHigherSpeedThanTheRobotIsAbleToIsExpectedOnlyWhereItIsKnown) {
  EXPECT_LT(speed_after_a_move({}, 10.0), 11.0);
  EXPECT_GT(speed_after_a_move({}, 0.5), 13.9);
  EXPECT_DOUBLE_EQ(speed_after_a_move({.max_speed_mps = 40.0}, 10.0), 14.0);
}

TEST(MotionFilter, WhatLidarSeesGoesBeyondAnyLimit) {
  for (const double max_mps : {0.1, 1.0, 10.0, 40.0}) {
    Robot robot(straight(14.0), {}, 1);
    MotionFilter filter(wheels_and_gyro(), {.max_speed_mps = max_mps});
    filter.begin(Pose{}, twist_of(14, 0, 0, 0, 0, 0), along_each_axis(0.05, 0.1));
    sweep_for(1.0, filter, robot, 0.1, {.wheels = false, .gyro = false, .lidar = usual_lidar(0.1)});
    EXPECT_NEAR(filter.pose().translation.x(), 14.0, 0.05) << max_mps;
  }
}

TEST(MotionFilter, ARobotThatIsAbleToMoreIsBelievedToDoMore) {
  const auto doubt_mps = [](const MotionLimits& limits) {
    MotionFilter filter(wheels_and_gyro(), limits);
    filter.begin(Pose{}, Vector6::Zero(), Vector6::Zero());
    filter.predict(0.1, 0.1, std::nullopt, kTranslation);
    return std::sqrt(filter.covariance()(6 + kX, 6 + kX));
  };
  EXPECT_NEAR(doubt_mps({.max_acceleration_mps2 = 30.0}), 3.0 * doubt_mps({}), 1e-9);
}

TEST(MotionFilter, PutMovesThePoseAndNothingElse) {
  MotionFilter filter = begun(twist_of(1, 0, 0, 0, 0, 0));
  const Matrix12 before = filter.covariance();
  const Pose elsewhere{so3_exp({0, 0, 0.1}), {1, 2, 3}};
  filter.put(elsewhere);
  EXPECT_EQ(filter.pose(), elsewhere);
  EXPECT_EQ(filter.covariance(), before);
  EXPECT_EQ(filter.twist_base(), twist_of(1, 0, 0, 0, 0, 0));
}

// --- Numbers ------------------------------------------------------------------------------------------------------

/// Anything in any order, as the days of a robot may bring it.
class AnyDay {
 public:
  explicit AnyDay(unsigned seed) : robot_(winding, {}, seed), random_(seed) {}

  void sweep(MotionFilter& filter) {
    const double elapsed_s = std::array{1e-6, 0.05, 0.1, 0.1, 0.1, 0.1, 0.3, 2.0}[any(8)];
    robot_.move(elapsed_s);
    filter.predict(elapsed_s, 0.1, maybe() ? std::optional(robot_.force()) : std::nullopt,
                   {.translation = maybe(), .rotation = maybe()});
    if (maybe())
      filter.measure(kGyroSource, robot_.gyro(), kRotation);
    if (maybe())
      filter.measure(kWheelSource, robot_.wheels(), std::array{kTranslation, kRotation, kAll}[any(3)]);
    const std::size_t what = any(10);
    if (what == 7)
      filter.rest();
    filter.move();
    if (what < 5)
      see(filter, robot_, usual_lidar(std::max(elapsed_s, 0.05)));
    else if (what < 7)
      see(filter, robot_, blind_ahead(usual_lidar(std::max(elapsed_s, 0.05))));
    if (maybe())
      filter.learn();
    if (any(5) == 0)
      filter.keep(0.1 * static_cast<double>(any(11)) * Matrix6::Identity());
    if (any(100) == 0)
      filter.forget(SourceId{any(2)});
    if (any(100) == 0)
      filter.put(robot_.pose());
  }

 private:
  std::size_t any(std::size_t count) { return random_() % count; }
  bool maybe() { return any(2) == 0; }

  Robot robot_;
  std::mt19937 random_;
};

TEST(MotionFilter, TheCovarianceStaysACovarianceWhateverComes) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    AnyDay day(seed);
    MotionFilter filter = begun(winding(0.0));
    for (int i = 0; i < 10'000; ++i) {
      day.sweep(filter);
      ASSERT_TRUE(is_sound(filter.covariance())) << "sweep " << i << "\n" << filter.covariance();
      ASSERT_TRUE(filter.pose_covariance_since_start().allFinite());
      ASSERT_TRUE(filter.pose().finite() && filter.twist_base().allFinite() && filter.state().allFinite());
    }
  }
}

TEST(MotionFilter, TheCovarianceStaysACovarianceOverAnHourInATunnel) {
  Robot robot(straight(1.5), {}, 1);
  MotionFilter filter = begun_with(robot, straight(1.5));
  for (int minute = 0; minute < 60; ++minute) {
    sweep_for(60.0, filter, robot, 0.1, {.force = true, .lidar = blind_ahead(usual_lidar(0.1))});
    ASSERT_TRUE(is_sound(filter.covariance())) << minute << " min\n" << filter.covariance();
  }
}

TEST(MotionFilter, SweepsOfAMicrosecondAreFigures) {
  constexpr double kMoment_s = 1e-6;
  for (const bool force : {false, true}) {
    Robot robot(winding, {}, 1);
    MotionFilter filter = begun_with(robot, winding);
    const auto expect_figures = [&] {
      EXPECT_TRUE(filter.pose().finite() && filter.twist_base().allFinite() && filter.state().allFinite());
      EXPECT_TRUE(is_sound(filter.covariance())) << filter.covariance();
      EXPECT_TRUE(filter.belief().information.allFinite());
      const Innovation found = filter.innovation(kWheelSource, robot.twist());
      EXPECT_TRUE(found.value.allFinite() && found.variance.allFinite());
    };
    for (int i = 0; i < 20; ++i) {
      sweep(filter, robot, kMoment_s, {.force = force, .lidar = usual_lidar(0.1)});
      expect_figures();
    }
    sweep(filter, robot, 0.1, {.force = force, .lidar = usual_lidar(0.1)});
    expect_figures();
    sweep(filter, robot, kMoment_s, {.force = force});
    expect_figures();
  }
}

TEST(MotionFilter, ACopyThatIsToldTheSameIsTheSameToTheBit) {
  AnyDay day(7), same_day(7);
  MotionFilter filter = begun(winding(0.0));
  for (int i = 0; i < 100; ++i) {
    day.sweep(filter);
    MotionFilter unused = begun(winding(0.0));
    same_day.sweep(unused);
  }
  // The days are at the same place now only if nothing that they do depends on the filter.
  MotionFilter copy = filter;
  for (int i = 0; i < 100; ++i) {
    day.sweep(filter);
    same_day.sweep(copy);
    ASSERT_EQ(filter.pose(), copy.pose());
    ASSERT_EQ(filter.twist_base(), copy.twist_base());
    ASSERT_EQ(filter.state(), copy.state());
    ASSERT_EQ(filter.covariance(), copy.covariance());
    ASSERT_EQ(filter.pose_covariance_since_start(), copy.pose_covariance_since_start());
  }
}

} // namespace
} // namespace locus
