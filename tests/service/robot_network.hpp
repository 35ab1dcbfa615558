// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "replay/replay_run.hpp"
#include "support/child.hpp"

namespace locus::test {

/// A network of the test's own, with the loopback interface up: no port and no DDS domain is shared with anybody. The
/// programs that a test starts live in it, too. Skips where the system does not allow that.
class RobotNetwork : public testing::Test {
 protected:
  void SetUp() override;

  /// What a robot brings back from 20 s, with odometry and IMU.
  static std::filesystem::path capture();

  /// A drive of locus-sim, whose lidar is locked to PPS: how late this machine wakes up who plays it is not seen in the
  /// stamps.
  static std::filesystem::path plant();

  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }
  /// Socket of the service, in a runtime folder on a tmpfs as it is on a robot.
  [[nodiscard]] std::filesystem::path control() const { return runtime_ / "control"; }
  /// Of the capture, with more lines of YAML.
  [[nodiscard]] std::filesystem::path config(const std::string& more = "") const;
  /// Of the capture, with another value of a key of the lidar.
  [[nodiscard]] std::filesystem::path lidar_with(const std::string& key_and_value) const;

  /// A pair of interfaces robot0 and robot1 that are up, robot0 at 10.7.0.1. Nothing where this kernel has none.
  [[nodiscard]] static bool add_interfaces();

  /// Command that plays a drive again and again, for tests that must not run into its end.
  [[nodiscard]] static std::vector<std::string> endlessly(const std::filesystem::path& drive);

  /// Commands of a service and of a player that leads its time (support/led_clock.hpp): the service hears each input
  /// when the recording has it, drops none, and ends no registration early, however busy the computer is.
  [[nodiscard]] std::vector<std::string> led_locusd(const std::filesystem::path& config) const;
  [[nodiscard]] std::vector<std::string> leading_play(std::vector<std::string> options) const;

  [[nodiscard]] static std::vector<std::string> locusd(const std::filesystem::path& config) {
    return {LOCUSD, "--config", config.string()};
  }

  /// What locusctl says; the state of the service lies in the folder of the test.
  [[nodiscard]] ProgramRun ctl(std::vector<std::string> words) const;
  [[nodiscard]] nlohmann::json status() const;
  /// The first status of which it holds; else a discarded one, and a failure of the test.
  nlohmann::json status_when(const std::function<bool(const nlohmann::json&)>& holds) const;
  bool status_comes(const std::function<bool(const nlohmann::json&)>& holds) const;

 private:
  TemporaryFolder folder_, runtime_{"/dev/shm"};
};

/// Whether it comes true before the test's patience ends.
bool comes_true(const std::function<bool()>& holds);

/// Whether a peer that listens hears all estimates from now on: it knows the writer, and the service, which learns of a
/// peer's readers in the order of their making, knows a reader that was made after that of the estimates.
bool hears_the_service(const Child& peer);

/// The first processor that this process may run on.
int first_processor();

/// How many packets a capture holds.
std::uint64_t datagrams_in(const std::filesystem::path& file);

/// Where a peer heard the robot to be.
struct HeardPose {
  Stamp stamp;
  Pose T_odom_base;
  Stamp heard;
};
std::vector<HeardPose> heard(const Child& peer, const std::string& topic = "odometry");

/// By what locus-play, which has come to its end, moved all stamps.
Duration shift_of(const Child& play);

/// How far the poses are from where they were expected at their stamps, less the shift.
double worst_distance_m(const std::vector<StampedPose>& expected, const std::vector<HeardPose>& heard, Duration shift);

} // namespace locus::test
