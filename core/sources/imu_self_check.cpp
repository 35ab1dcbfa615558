// SPDX-License-Identifier: Apache-2.0
#include "core/sources/imu_self_check.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/sources/health_monitor.hpp"

namespace locus {

namespace {

constexpr Duration kWeighFor = std::chrono::seconds{1};
constexpr double kGravityTolerance = 0.15; ///< relative; the robot may be accelerating
constexpr double kEarlyTolerance = 0.3;    ///< relative, of the mean until then: a few samples of a shaking robot
constexpr double kMaxTilt_deg = 60.0;      ///< no robot starts on a steeper slope

/// Number of turning sweeps to quarantine a gyro, to use it again, and to judge it.
constexpr int kSweepsToDoubt = 2, kSweepsToConfirm = 3, kSweepsToJudge = 10;
constexpr int kRounds = 3; ///< quarantines until it is rejected although the cause is unclear

constexpr double kLikeness = 0.7;
constexpr double kScaleTolerance = 0.5; ///< sweeps without motion correction are distorted
constexpr double kDegPerRad = 1.0 / kRadPerDeg;
constexpr double kMuchMore = 7.6; ///< square root of kDegPerRad: from here on deg/s are likelier than rad/s

constexpr std::string_view kInDegrees =
    "and lidar disagree on how much the robot turns: the gyro reports some 57 times as much, as if in deg/s, not in "
    "rad/s; it is not used any more, until a restart (possible cause: the unit of its driver)";

constexpr Duration kMaxGap = std::chrono::milliseconds{100};   ///< across which the gyro is integrated
constexpr Duration kResolution = std::chrono::milliseconds{5}; ///< of the stored turns

bool is_about(double value, double expected, double tolerance) {
  return std::abs(value - expected) < tolerance * expected;
}

} // namespace

ImuSelfCheck::ImuSelfCheck(const Pose& T_base_imu, UseAcceleration use_acceleration)
    : R_base_imu_(T_base_imu.rotation), use_acceleration_(use_acceleration) {
  static_cast<void>(words(Difference::any, 0, false)); // allocates the texts now, not while packets arrive
}

std::optional<HealthReason> ImuSelfCheck::judge(const SourceReading& reading) {
  follow_turns(R_base_imu_ * reading.imu->angular_velocity_radps, reading.stamp);
  if (refused_)
    return HealthReason::self_check;
  if (use_acceleration_ == UseAcceleration::automatic)
    weigh(R_base_imu_ * reading.imu->specific_force_mps2, reading.stamp);
  return refused_ || set_aside_ ? std::optional{HealthReason::self_check} : std::nullopt;
}

std::string_view ImuSelfCheck::verdict() const { return set_aside_ && !refused_ ? set_aside_verdict_ : verdict_; }

void ImuSelfCheck::weigh(const Eigen::Vector3d& specific_force_base_mps2, Stamp stamp) {
  if (weighed_)
    return;
  if (!first_)
    first_ = stamp;
  force_sum_mps2_ += specific_force_base_mps2;
  forces_ += 1.0;
  if (stamp - *first_ >= kWeighFor)
    weigh_gravity();
}

bool ImuSelfCheck::trusts_accelerometer() const {
  return use_acceleration_ == UseAcceleration::automatic && trusts_accelerometer_ && (weighed_ || may_be_gravity());
}

/// Judges by the mean of the forces so far. Without a sample the result is false.
bool ImuSelfCheck::may_be_gravity() const {
  return forces_ > 0.0 && is_about(force_sum_mps2_.norm() / forces_, kGravity_mps2, kEarlyTolerance);
}

void ImuSelfCheck::follow_turns(const Eigen::Vector3d& turn_rate_base_radps, Stamp stamp) {
  const Duration step = last_ ? stamp - *last_ : kMaxGap;
  if (step <= Duration{} && step > -kMaxGap)
    return;
  if (std::chrono::abs(step) < kMaxGap)
    angle_rad_ += to_seconds(step) * turn_rate_base_radps;
  else
    count_ = 0;
  last_ = stamp;
  if (count_ > 0 && stamp - turned_[newest_].stamp < kResolution)
    return;
  newest_ = (newest_ + 1) % turned_.size();
  turned_[newest_] = {stamp, angle_rad_};
  count_ = std::min(count_ + 1, turned_.size());
}

const ImuSelfCheck::Turned& ImuSelfCheck::by_age(std::size_t age) const {
  return turned_[(newest_ + turned_.size() - age) % turned_.size()];
}

bool ImuSelfCheck::covers(Stamp stamp) const {
  return count_ > 1 && stamp >= by_age(count_ - 1).stamp && stamp < by_age(0).stamp + kMaxGap;
}

/// Interpolates; outside the stored range, returns the nearest angle. Precondition: something is stored.
Eigen::Vector3d ImuSelfCheck::angle_rad_at(Stamp stamp) const {
  std::size_t age = 0;
  while (age + 1 < count_ && by_age(age).stamp > stamp)
    ++age;
  const Turned& before = by_age(age);
  if (age == 0 || stamp <= before.stamp)
    return before.angle_rad;
  const Turned& after = by_age(age - 1);
  const double fraction = to_seconds(stamp - before.stamp) / to_seconds(after.stamp - before.stamp);
  return before.angle_rad + fraction * (after.angle_rad - before.angle_rad);
}

void ImuSelfCheck::weigh_gravity() {
  weighed_ = true;
  const Eigen::Vector3d force = force_sum_mps2_ / forces_;
  if (is_about(force.norm(), 1.0, kGravityTolerance)) {
    trusts_accelerometer_ = false;
    verdict_ = "reports accelerations of about 1 where gravity is 9.8 m/s^2, as if in g: they are not used";
  } else if (!is_about(force.norm(), kGravity_mps2, kGravityTolerance)) {
    trusts_accelerometer_ = false;
    verdict_ =
        "reports accelerations that are not those of gravity in the mean of a second: they are not used (possible "
        "causes: their unit or scale, or a robot that sped up all the while)";
  }
  if (force.norm() > 0.0 && force.normalized().z() < std::cos(kMaxTilt_deg * kRadPerDeg))
    refuse(
        "measures that gravity is not below the robot, but more than 60 degrees from there: it is not used (possible "
        "causes: T_base_source, how the unit is mounted, the convention of its axes, or a robot that lay on its side)");
}

void ImuSelfCheck::accept(const SourceReading& reading) {
  if (was_lost_ && !back_since_)
    back_since_ = reading.stamp;
}

/// Returns whether the unit is on probation. Meanwhile lidar runs without gyro de-skew, and its sweeps are distorted
/// while the robot turns: no evidence against a gyro that was not in doubt.
bool ImuSelfCheck::is_yet_to_be_used(const RegistrationFeedback& feedback) const {
  return !set_aside_ && back_since_ && feedback.from < *back_since_ + HealthMonitor::kProbation;
}

std::optional<HealthReason> ImuSelfCheck::on_feedback(LidarOpinion /*opinion*/, const RegistrationFeedback& feedback) {
  if (is_yet_to_be_used(feedback))
    return std::nullopt;
  const bool was_set_aside = set_aside_;
  const std::string_view before = verdict_;
  compare_axes(feedback);
  if (!refused_ && covers(feedback.from) && covers(feedback.to)) {
    compare(feedback);
    review();
  }
  const bool is_lost = (refused_ && verdict_ != before) || (set_aside_ && !was_set_aside);
  return is_lost ? std::optional{HealthReason::self_check} : std::nullopt;
}

/// Stores the sweep, and compares those whose turns the gyro's samples cover by now.
void ImuSelfCheck::compare_axes(const RegistrationFeedback& feedback) {
  if (feedback.observes[3] && feedback.observes[4] && feedback.observes[5]) {
    if (seen_count_ == seen_.size()) {
      oldest_seen_ = (oldest_seen_ + 1) % seen_.size();
      --seen_count_;
    }
    const double elapsed_s = to_seconds(feedback.to - feedback.from);
    seen_[(oldest_seen_ + seen_count_++) % seen_.size()] = {feedback.from, feedback.to,
                                                            elapsed_s * feedback.twist_base.tail<3>()};
  }
  for (; seen_count_ > 0 && count_ > 0; --seen_count_) {
    const Seen& seen = seen_[oldest_seen_];
    if (by_age(0).stamp < seen.to + AxesCheck::kMostLate)
      break;
    compare_axes(seen);
    oldest_seen_ = (oldest_seen_ + 1) % seen_.size();
  }
  if (axes_check_.is_in_degrees())
    refuse(kInDegrees); // also if it was refused for what its first turns looked like
  else if (axes_check_.is_wrong() && !refused_)
    refuse("and lidar disagree on the axes about which the robot turns: those of the gyro are exchanged or reversed; "
           "it is not used any more, until a restart (possible causes: T_base_source, the driver of the gyro, or "
           "T_base_lidar)");
}

void ImuSelfCheck::compare_axes(const Seen& seen) {
  if (!covers(seen.from - AxesCheck::kMostLate) || seen.from >= seen.to)
    return;
  AxesCheck::GyroTurns gyro_rad;
  for (std::size_t i = 0; i < gyro_rad.size(); ++i)
    gyro_rad[i] = angle_rad_at(seen.to + AxesCheck::late(i)) - angle_rad_at(seen.from + AxesCheck::late(i));
  axes_check_.add(seen.lidar_rad, gyro_rad, to_seconds(seen.to - seen.from));
}

void ImuSelfCheck::compare(const RegistrationFeedback& feedback) {
  const Eigen::Vector3d gyro_rad = angle_rad_at(feedback.to) - angle_rad_at(feedback.from);
  const Eigen::Vector3d lidar_rad = to_seconds(feedback.to - feedback.from) * feedback.twist_base.tail<3>();
  const double noise_rad = AxesCheck::noise_rad(gyro_rad, lidar_rad);
  for (std::size_t i = 0; i < turns_.size(); ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    const bool turned = std::max(std::abs(gyro_rad[axis]), std::abs(lidar_rad[axis])) > noise_rad;
    if (turned && feedback.observes[3 + i] && !(turns_[i].agree() && turns_[i].sweeps >= kSweepsToJudge))
      turns_[i].add(gyro_rad[axis], lidar_rad[axis]);
  }
}

void ImuSelfCheck::Turns::add(double gyro_rad, double lidar_rad) {
  lidar_lidar += lidar_rad * lidar_rad;
  gyro_lidar += gyro_rad * lidar_rad;
  gyro_gyro += gyro_rad * gyro_rad;
  ++sweeps;
}

double ImuSelfCheck::Turns::likeness() const { return gyro_lidar / std::sqrt(gyro_gyro * lidar_lidar); }

/// Classifies the difference. A gyro that hardly reports turns gives no further evidence.
ImuSelfCheck::Difference ImuSelfCheck::Turns::difference() const {
  if (gyro_gyro < sweeps * AxesCheck::kNoise_rad * AxesCheck::kNoise_rad)
    return Difference::gyro_still;
  if (likeness() < -kLikeness && gyro_gyro < -kMuchMore * gyro_lidar)
    return Difference::opposite;
  return has_scale(kDegPerRad) ? Difference::degrees : Difference::any;
}

/// Returns whether the gyro reports `scale` times the turns of lidar. All noise is attributed to lidar.
bool ImuSelfCheck::Turns::has_scale(double scale) const {
  return likeness() > kLikeness && std::abs(gyro_gyro / gyro_lidar - scale) < kScaleTolerance * scale;
}

void ImuSelfCheck::review() {
  const auto any = [&](int sweeps, bool agrees) {
    return std::ranges::any_of(turns_, [=](const Turns& t) { return t.sweeps >= sweeps && t.agree() == agrees; });
  };
  const bool contradicted = any(kSweepsToDoubt, false);
  if (!set_aside_ && contradicted) {
    set_aside_ = true;
    const std::size_t axis = contradicted_axis(kSweepsToDoubt);
    set_aside_verdict_ = words(turns_[axis].difference(), axis, false);
    turns_ = {};
  } else if (set_aside_ && contradicted && any(kSweepsToJudge, false)) {
    conclude();
  } else if (set_aside_ && !contradicted && any(kSweepsToConfirm, true)) {
    set_aside_ = false;
  }
}

/// Rejects the unit, or gives it another try if the cause is unclear: without it lidar may not follow the turns of a
/// gait.
void ImuSelfCheck::conclude() {
  for (std::size_t axis = 0; axis < turns_.size(); ++axis) {
    const Turns& turns = turns_[axis];
    if (turns.sweeps >= kSweepsToJudge && (turns.likeness() < -kLikeness || turns.has_scale(kDegPerRad)))
      refuse(words(turns.difference(), axis, true));
  }
  const std::size_t axis = contradicted_axis(kSweepsToJudge);
  if (!refused_ && ++rounds_ == kRounds)
    refuse(words(turns_[axis].difference(), axis, true));
  set_aside_ = false;
  turns_ = {};
}

/// Returns the first axis on which gyro and lidar disagree. Precondition: there is one with `sweeps` turning sweeps.
std::size_t ImuSelfCheck::contradicted_axis(int sweeps) const {
  const auto found =
      std::ranges::find_if(turns_, [=](const Turns& turns) { return turns.sweeps >= sweeps && !turns.agree(); });
  return static_cast<std::size_t>(found - turns_.begin());
}

/// Returns a text of static lifetime.
std::string_view ImuSelfCheck::words(Difference difference, std::size_t axis, bool for_good) {
  struct Finding {
    const char* observation;
    const char* causes;
  };
  constexpr std::array<Finding, 4> kFindings{
      Finding{
          "they measure different turns",
          "T_base_source, scale, stamps or delay of the gyro, or lidar that follows moving objects around the robot"},
      Finding{"lidar measures turns and the gyro hardly any",
              "people or objects that move around a robot at rest, T_base_source, delay or a dead axis of the gyro"},
      Finding{"the gyro turns the other way", "T_base_source, the sign of an axis, delay of the gyro, or lidar that "
                                              "follows moving objects around the robot"},
      Finding{"the gyro reports some 57 times as much, as if in deg/s, not in rad/s", "the unit of its driver"}};
  constexpr std::array<const char*, 3> kAxes{"x (roll)", "y (pitch)", "z (yaw)"};
  using Words = std::array<std::array<std::array<std::string, 2>, kAxes.size()>, kFindings.size()>;
  static const Words all = [&] {
    Words words;
    for (std::size_t i = 0; i < words.size(); ++i)
      for (std::size_t k = 0; k < kAxes.size(); ++k)
        for (std::size_t good = 0; good < 2; ++good)
          words[i][k][good] = std::string("and lidar disagree on how the robot turns about ") + kAxes[k] + ": " +
                              kFindings[i].observation + "; it is not used " +
                              (good == 1 ? "any more, until a restart" : "until they agree") +
                              " (possible causes: " + kFindings[i].causes + ")";
    return words;
  }();
  return all[static_cast<std::size_t>(difference)][axis][for_good ? 1 : 0];
}

/// Restarts the check: a source that comes back is checked as at the start. Evidence on the axes is dropped, too: lidar
/// follows a gyro as long as it is used.
void ImuSelfCheck::reset() {
  if (refused_)
    return;
  axes_check_ = {};
  if (!set_aside_)
    turns_ = {};
  was_lost_ = true;
  back_since_.reset();
  first_.reset();
  last_.reset();
  count_ = 0;
  weighed_ = false;
  force_sum_mps2_.setZero();
  forces_ = 0.0;
}

void ImuSelfCheck::refuse(std::string_view verdict) {
  if (!axes_check_.is_wrong() && !axes_check_.is_in_degrees())
    axes_check_ = {};
  refused_ = true;
  verdict_ = verdict;
}

} // namespace locus
