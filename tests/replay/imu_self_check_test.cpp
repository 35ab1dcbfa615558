// SPDX-License-Identifier: Apache-2.0
// Drives with a faulty IMU, whose data must not distort the reference that it is compared with.
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "simulated_drive.hpp"

namespace locus::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;

/// A gyro fault, and its description in messages.
struct Wrong {
  void (*gyro)(Eigen::Vector3d& turn_radps);
  std::string words;
};
const Wrong kOtherWay{[](Eigen::Vector3d& turn_radps) { turn_radps.z() *= -1.0; }, "the gyro turns the other way"};
const Wrong kDegrees{[](Eigen::Vector3d& turn_radps) { turn_radps /= kRadPerDeg; }, "deg/s"};

/// Writes the samples of the drive without attitude: faulty from `good_for` on, and missing in the second before.
void write_wrong(const Wrong& wrong, const SimulatedDrive& drive, Duration good_for, const std::filesystem::path& to) {
  auto samples = MotionSamples<ImuSample>::open(drive.capture() + "/imu.csv");
  ASSERT_TRUE(samples) << samples.error();
  const Stamp wrong_from = samples->front()->stamp + good_for;
  std::ofstream file(to);
  for (ImuSample& sample : samples->drain()) {
    if (sample.stamp < wrong_from && sample.stamp > wrong_from - seconds{1})
      continue;
    if (sample.stamp >= wrong_from)
      wrong.gyro(sample.angular_velocity_radps);
    file << sample.stamp.time_since_epoch().count();
    for (const Eigen::Vector3d& axes : {sample.angular_velocity_radps, sample.specific_force_mps2})
      file << ',' << axes.x() << ',' << axes.y() << ',' << axes.z();
    file << '\n';
  }
}

Replay replay_with(const Wrong& wrong, const SimulatedDrive& drive, std::vector<std::string> arguments = {},
                   Duration good_for = Duration::zero()) {
  const TemporaryFolder folder;
  const std::filesystem::path imu = folder / "imu.csv";
  write_wrong(wrong, drive, good_for, imu);
  arguments.insert(arguments.end(), {"--imu", imu.string()});
  return drive.replay(arguments);
}

/// Expects the IMU to be rejected by name, no other source to be affected, and the accuracy to equal that without an
/// IMU.
void expect_refused(const Replay& replay, const Wrong& wrong, double without_m) {
  SCOPED_TRACE(wrong.words);
  ASSERT_EQ(replay.run().status, 0) << replay.run().err;
  const json summary = replay.summary();
  EXPECT_NE(replay.run().err.find(wrong.words), std::string::npos) << replay.run().err;
  EXPECT_GE(summary["sources"]["imu"]["rejected"]["self_check"], 1);
  EXPECT_NE(summary["sources"]["imu"]["verdict"].get<std::string>().find(wrong.words), std::string::npos);
  EXPECT_EQ(summary["sweeps"]["failed"], 0);
  EXPECT_LT(ape_mean_m(replay), 1.2 * without_m);
  for (const auto& [name, source] : summary["sources"].items()) {
    if (name != "imu") {
      EXPECT_EQ(source["health_changes"], 0) << name << '\n' << replay.run().out;
    }
  }
}

/// Straight ahead for 20 s, a curve, and after 38 s a turn on the spot. Simulated once per test process.
const SimulatedDrive& wheels() {
  static const SimulatedDrive drive("urban", "husky", 60);
  return drive;
}

TEST(WrongImu, OnWheelsIsRejectedBeforeItDistortsTheMap) {
  const SimulatedDrive& drive = wheels();
  EXPECT_EQ(drive.replay().summary()["sources"]["imu"]["health_changes"], 0) << "correct IMU";
  for (const Wrong& wrong : {kOtherWay, kDegrees})
    expect_refused(replay_with(wrong, drive), wrong, without_imu_m(drive));
}

TEST(WrongImu, AfterALossIsRejected) {
  const SimulatedDrive& drive = wheels();
  expect_refused(replay_with(kOtherWay, drive, {}, seconds{8}), kOtherWay, without_imu_m(drive));
}

TEST(WrongImu, WithLidarAloneIsRejected) {
  const SimulatedDrive& drive = wheels();
  const double alone_m = ape_mean_m(drive.replay({"--fail", "wio:lost@0", "--fail", "imu:lost@0"}));
  for (const Wrong& wrong : {kOtherWay, kDegrees}) {
    SCOPED_TRACE(wrong.words);
    const Replay replay = replay_with(wrong, drive, {"--fail", "wio:lost@0"});
    EXPECT_NE(replay.run().err.find(wrong.words), std::string::npos) << replay.run().err;
    EXPECT_LT(ape_mean_m(replay), 1.5 * alone_m);
  }
}

TEST(WrongImu, OnLegsIsRejectedAlthoughTheGaitAgrees) {
  const SimulatedDrive drive("urban", "spot", 25);
  const json good = drive.replay().summary();
  EXPECT_EQ(good["sources"]["imu"]["health_changes"], 0);
  EXPECT_GT(good["sources"]["imu"]["used_sweeps"], 240);
  for (const Wrong& wrong : {kOtherWay, kDegrees})
    expect_refused(replay_with(wrong, drive), wrong, without_imu_m(drive));
}

} // namespace
} // namespace locus::test
