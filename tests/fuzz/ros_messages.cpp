// SPDX-License-Identifier: Apache-2.0
// IMU and odometry samples from DDS, validated and tracked as by the ingest. A message is derived from the previous one
// by changing a part, so that a few bytes make a stream.
#include <chrono>
#include <utility>

#include "core/sources/health_monitor.hpp"
#include "core/sources/motion_track.hpp"
#include "daemon/dds/ros_messages.hpp"
#include "fuzz/fuzz_bytes.hpp"

namespace locus {
namespace {

using fuzz::demand;
using fuzz::FuzzBytes;

/// First byte of a message: the parts that change.
enum Step : std::uint8_t {
  kOdometry = 1,
  kStamp = 2,
  kArrival = 4,
  kRotation = 8,
  kVectors = 16, ///< position, or angular rate and specific force
  kCovariance = 32,
  kOutside = 64,
};

template <class... Part> void refill(FuzzBytes& bytes, Part&... parts) {
  (bytes.fill(std::as_writable_bytes(std::span{&parts, 1})), ...);
}

/// One source, from its topic to its track.
struct Source {
  explicit Source(SourceKind kind) : options{.name = "fuzz", .kind = kind, .T_base_source = {}}, track(options) {}

  template <class Sample> void take(Sample sample) {
    const auto stamp = health.judge(sample);
    if (std::exchange(epoch, health.epoch()) != health.epoch())
      track.clear();
    if (!stamp)
      return;
    sample.stamp = *stamp;
    track.add(sample);
    for (const Stamp at : {*stamp, *stamp - std::chrono::microseconds{1}, *stamp + MotionTrack::kMaxExtrapolation}) {
      const auto pose = track.at(at);
      demand(!pose || pose->finite());
    }
  }
  void begin_anew() {
    health = HealthMonitor{options};
    epoch = health.epoch();
    track.clear();
  }

  MotionSourceOptions options;
  HealthMonitor health{options};
  std::uint32_t epoch = 0;
  MotionTrack track;
};

} // namespace
} // namespace locus

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  namespace ros = daemon::ros;
  static Source imu_source{SourceKind::imu}, odometry_source{SourceKind::odometry};
  imu_source.begin_anew();
  odometry_source.begin_anew();
  daemon::UsualCovariance usual;
  ros::Imu imu{};
  ros::Odometry odometry{};
  Duration arrival = std::chrono::seconds{1'700'000'000};
  for (FuzzBytes bytes{data, size}; !bytes.empty();) {
    const auto step = bytes.take<std::uint8_t>();
    const bool is_odometry = (step & kOdometry) != 0;
    arrival += std::chrono::microseconds{bytes.take<std::uint16_t>()};
    if ((step & kArrival) != 0)
      arrival = std::chrono::seconds{bytes.take<std::uint32_t>()};
    ros::Time& stamp = is_odometry ? odometry.header_.stamp_ : imu.header_.stamp_;
    if ((step & kStamp) != 0)
      refill(bytes, stamp.sec_, stamp.nanosec_);
    else
      stamp = daemon::to_ros(Stamp{arrival});
    if ((step & kRotation) != 0)
      refill(bytes, is_odometry ? odometry.pose_.pose_.orientation_ : imu.orientation_);
    if ((step & kVectors) != 0 && is_odometry)
      refill(bytes, odometry.pose_.pose_.position_);
    else if ((step & kVectors) != 0)
      refill(bytes, imu.angular_velocity_, imu.linear_acceleration_);
    if ((step & kCovariance) != 0 && is_odometry)
      refill(bytes, odometry.twist_.covariance_[bytes.take<std::uint8_t>() % 36]);
    else if ((step & kCovariance) != 0)
      refill(bytes, imu.orientation_covariance_[0]);
    HealthMonitor& health = is_odometry ? odometry_source.health : imu_source.health;
    if ((step & kOutside) != 0)
      health.set_outside_verdict((bytes.take<std::uint8_t>() & 1) != 0, Stamp{arrival});
    if (is_odometry)
      odometry_source.take(daemon::to_sample(odometry, Stamp{arrival}, usual));
    else
      imu_source.take(daemon::to_sample(imu, Stamp{arrival}));
  }
  return 0;
}
