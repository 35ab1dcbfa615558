// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/expected.hpp"
#include "core/base/stamp.hpp"

namespace locus {

enum class FaultKind : std::uint8_t {
  lost,   ///< nothing arrives
  frozen, ///< the last reading before the fault is repeated; messages of motion sources get new stamps
  jump,   ///< the reading is offset by `value` (2): a pose by metres along x of the source's frame, a lidar's ranges by
          ///< metres, an IMU's yaw rate by rad/s
  nan,    ///< all readings are NaN
  late,   ///< everything arrives `value` seconds late (0.2)
  covariance,  ///< the reported covariance is multiplied by `value` (10)
  clock_step,  ///< the sensor's own clock is offset by `value` seconds (60); a Velodyne's wraps at the hour
  packet_loss, ///< `value` percent of the messages are lost (10)
  reorder,     ///< `value` percent of the messages are overtaken by the next one of the same sensor (10)
  duplicate,   ///< `value` percent of the messages arrive twice (10)
  view,        ///< a lidar has no returns but from `value` degrees about its x axis (180)
  corrupt,     ///< `value` percent of the messages contain random bits, a packet's from a random byte on (10)
};

/// Returns the name as users write it: clock-step.
std::string_view to_string(FaultKind kind);

/// Fault to inject into the recording of one sensor, as users write it: `NAME:KIND[=VALUE]@T[-T1]`, for example
/// `front:lost@10-20` or `wio:jump=5@30`. KIND is named as in FaultKind with - for _, which also lists the defaults of
/// VALUE.
struct Fault {
  static constexpr std::string_view kAllLidars = "all-lidars";
  static constexpr std::string_view kPositionPackets = ".position"; ///< after a lidar's name: only these
  static constexpr std::string_view kInertialUnit = "_imu";         ///< after an Ouster's name: its motion source

  std::string name; ///< lidar, motion source, or kAllLidars
  FaultKind kind = FaultKind::lost;
  double value = 0.0;
  Duration from{};                  ///< after the start of the capture; 0: from the very first message
  Duration until = Duration::max(); ///< first instant after the fault

  /// Returns whether it affects the lidar of this name, or, with kPositionPackets or kInertialUnit appended, such
  /// packets.
  [[nodiscard]] bool strikes_lidar(std::string_view lidar) const;

  /// Parses a fault. Fails with one line for the user: the mistake and the accepted form.
  static Expected<Fault, std::string> parse(std::string_view text);
};

/// Sensor that a fault may apply to.
struct FaultTarget {
  enum class Kind : std::uint8_t { lidar, position_packets, odometry, imu };
  std::string name;
  Kind kind = Kind::lidar;
};

/// Returns one line for the user if the fault names no sensor of `targets`, or one that cannot have it (a lidar has no
/// covariance).
std::optional<std::string> fault_problem(const Fault& fault, std::span<const FaultTarget> targets);

/// Decides the effect of the faults of a run, message by message. Seeded: the same messages in the same order give the
/// same result on every run. One owner.
class FaultPlan {
 public:
  /// Effect on one message.
  struct Verdict {
    bool lost = false;
    bool frozen = false;
    bool nan = false;
    bool overtaken = false;
    bool duplicated = false;
    std::optional<std::uint64_t> corruption; ///< seed of the random bits
    Duration delay{};
    Duration clock_step{};
    double jump = 0.0;
    double covariance_scale = 1.0;
    double view_deg = 360.0;

    [[nodiscard]] bool harmless() const { return *this == Verdict{}; }
    bool operator==(const Verdict&) const = default;
  };

  FaultPlan(std::span<const Fault> faults, Stamp capture_start, std::uint64_t seed);

  /// Decides for a message of `sensor` that would arrive at `arrival` without faults.
  Verdict judge(std::string_view sensor, bool is_lidar, Stamp arrival);

 private:
  struct Entry {
    Fault fault;
    std::mt19937_64 random; ///< separate for each fault, so that they do not affect each other's random numbers
  };

  Stamp capture_start_;
  std::vector<Entry> entries_;
};

} // namespace locus
