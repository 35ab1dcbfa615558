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

struct LedTime;

/// A network namespace per test, with the loopback interface up: ports and DDS domains are not shared. Child processes
/// of the test run in it, too. Skips if the system does not permit it.
class RobotNetwork : public testing::Test {
 protected:
  void SetUp() override;

  /// Returns a drive of 20 s with odometry and IMU.
  static std::filesystem::path capture();

  /// Returns a drive of locus-sim whose lidar is locked to PPS, so that the player's wake-up latency does not affect
  /// the stamps.
  static std::filesystem::path plant();

  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }
  /// Control socket of the service, in a runtime folder on a tmpfs as on a robot.
  [[nodiscard]] std::filesystem::path control() const { return runtime_in_use_ / "control"; }
  /// Has services that are started from now on use another runtime folder.
  void use_runtime_folder(const std::filesystem::path& folder);
  /// Returns the configuration of the capture, with more lines of YAML.
  [[nodiscard]] std::filesystem::path config(const std::string& more = "") const;
  /// Returns the configuration of the capture, with another value of a key of the lidar.
  [[nodiscard]] std::filesystem::path lidar_with(const std::string& key_and_value) const;

  /// Creates a pair of interfaces robot0 and robot1 that are up, robot0 at 10.7.0.1. False if the kernel does not
  /// support it.
  [[nodiscard]] static bool add_interfaces();

  /// Returns a command that plays a drive in a loop, for tests that must not reach its end.
  [[nodiscard]] static std::vector<std::string> endlessly(const std::filesystem::path& drive);

  /// Commands of a service and of a player that controls its time (support/led_clock.hpp): the service receives each
  /// input at its recorded time, drops none, and ends no registration early, however busy the computer is.
  [[nodiscard]] std::vector<std::string> led_locusd(const std::filesystem::path& config) const;
  [[nodiscard]] std::vector<std::string> leading_play(std::vector<std::string> options) const;

  /// Returns the time that both have in common, for as long as this process runs.
  [[nodiscard]] LedTime& led_time() const;
  /// Waits until the player holds the time where it is to.
  [[nodiscard]] bool is_held() const;

  [[nodiscard]] static std::vector<std::string> locusd(const std::filesystem::path& config) {
    return {LOCUSD, "--config", config.string()};
  }

  /// Runs locusctl; the state of the service is in the folder of the test.
  [[nodiscard]] ProgramRun ctl(std::vector<std::string> words) const;
  [[nodiscard]] nlohmann::json status() const;
  /// Returns the first status that satisfies the predicate; else a discarded one, and fails the test.
  nlohmann::json status_when(const std::function<bool(const nlohmann::json&)>& holds) const;
  bool status_comes(const std::function<bool(const nlohmann::json&)>& holds) const;

 private:
  TemporaryFolder folder_, runtime_{"/dev/shm"};
  std::filesystem::path runtime_in_use_;
};

/// Longest time in which a drive of 20 s ends whose time the player controls: a wait for more than one event.
Duration patience_of_a_drive();

/// Waits until it holds; false after the test's patience.
bool comes_true(const std::function<bool()>& holds);

/// Waits until a peer receives all estimates from now on: the peer knows the writer, and the service, which discovers a
/// peer's readers in the order of their creation, knows one that was created after that of the estimates.
bool hears_the_service(const Child& peer);

/// Returns the first processor in the affinity mask of this process.
int first_processor();

/// Returns the number of packets of a capture.
std::uint64_t datagrams_in(const std::filesystem::path& file);

/// A pose as received by a peer.
struct HeardPose {
  Stamp stamp;
  Pose T_odom_base;
  Stamp heard;
};
std::vector<HeardPose> heard(const Child& peer, const std::string& topic = "odometry");

/// Returns the offset that locus-play, which has ended, has added to all stamps.
Duration shift_of(const Child& play);

/// Expects every pose of a replay to be received by `who`, equal to 1 cm and 0.1 degrees. Stamps differ because arrival
/// jitter changes the estimated clock offset.
void expect_each_received(const std::vector<StampedPose>& replay, const std::vector<HeardPose>& heard, Duration shift,
                          const std::string& who);

/// Returns the largest distance of the received poses, their stamps less the shift, from the expected ones.
double worst_distance_m(const std::vector<StampedPose>& expected, const std::vector<HeardPose>& heard, Duration shift);

} // namespace locus::test
