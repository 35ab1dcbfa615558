// SPDX-License-Identifier: Apache-2.0
// Additional outputs of an Ouster: metadata, clock, IMU.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "drivers/files/capture.hpp"
#include "drivers/ouster/imu_packet.hpp"
#include "drivers/ouster/metadata.hpp"
#include "locus_sim/capture_writer.hpp"
#include "locus_sim/ouster_imu.hpp"
#include "locus_sim/ouster_sensor.hpp"
#include "locus_sim/robot.hpp"
#include "support/scenes.hpp"

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

SyntheticLidarOptions ouster(OusterModel model = OusterModel::os1_32) {
  return {.model = model, .port = 7502, .imu_port = 7503};
}

TEST(SimulatedOuster, MetadataHasModelModePortsAndBeams) {
  for (const auto& [model, name, beams] :
       {std::tuple{OusterModel::os1_32, "OS1-32", 32U}, std::tuple{OusterModel::os1_128, "OS1-128", 128U}}) {
    const ouster::Metadata metadata = OusterSensor(sim::ouster(model), Stamp{}).metadata();
    EXPECT_EQ(ouster::name_of(metadata), name);
    EXPECT_EQ(metadata.profile, ouster::Profile::rng19);
    EXPECT_EQ(metadata.columns_per_frame, 1024U);
    EXPECT_EQ(metadata.frames_per_s, 10);
    EXPECT_EQ(metadata.columns_in_window(), 1024U);
    EXPECT_EQ(metadata.pixels_per_column, beams);
    EXPECT_EQ(metadata.timestamp_mode, ouster::TimestampMode::internal_osc);
    EXPECT_EQ(metadata.lidar_port, 7502);
    EXPECT_EQ(metadata.imu_port, 7503);
    EXPECT_NE(metadata.serial_number, 0U);
    EXPECT_NE(metadata.init_id, 0U);
    EXPECT_NEAR(metadata.altitude_rad[0] - metadata.altitude_rad[beams - 1], 42.4 * kRadPerDeg, 1e-9);
    EXPECT_NEAR(metadata.beam_origin_radius_m, 0.0158, 1e-4);
  }
}

TEST(SimulatedOuster, ClockCountsFromTheSensorsStartAndRunsFast) {
  SyntheticLidarOptions options = ouster();
  const Stamp start = stamp_from_ns(1'700'000'000'000'000'000);
  const OusterSensor right(options, start);
  EXPECT_GT(right.shown_at(start), seconds{0});
  EXPECT_LE(right.shown_at(start), std::chrono::hours{1});
  EXPECT_EQ(right.shown_at_true(start + seconds{100}), right.shown_at(start) + seconds{100});
  options.drift = 1e-4;
  const OusterSensor fast(options, start);
  EXPECT_EQ(fast.shown_at_true(start + seconds{100}), fast.shown_at(start) + seconds{100} + milliseconds{10});
}

/// Rotates and swings the sensor: the IMU measures at its own position, in its own frame, at its own stamps.
TEST(SimulatedOuster, ImuMeasuresTheMotionAtItsMounting) {
  const Trajectory trajectory(Course{}.change_speed(1, milliseconds{200}).turn(4, 8.0), {},
                              {.height_m = 0.03, .tilt_rad = 0.03, .wavelength_m = 1});
  SyntheticLidarOptions options = ouster();
  options.T_base_lidar = {from_rpy_rad({0.1, 0.3, -0.7}), {0.2, -0.1, 0.9}};
  const OusterSensor sensor(options, trajectory.start());
  OusterImu imu(trajectory, options, {});
  SyntheticImu truth(trajectory, 100, {}, 1, options.T_base_lidar * sensor.metadata().T_sensor_imu);
  for (int i = 0; i < 70; ++i) {
    const Datagram datagram = imu.next();
    const ImuSample expected = truth.next();
    ouster::ImuMeasurements measured;
    ASSERT_FALSE(ouster::read_imu_packet(sensor.metadata(), datagram.payload, measured));
    ASSERT_EQ(measured.count, 1U);
    const ouster::ImuMeasurement& one = measured.storage.front();
    ASSERT_EQ(datagram.destination_port, 7503);
    ASSERT_EQ(one.time, sensor.shown_at(expected.stamp));
    ASSERT_LT((one.angular_velocity_radps - expected.angular_velocity_radps).norm(), 1e-5);
    ASSERT_LT((one.specific_force_mps2 - expected.specific_force_mps2).norm(), 1e-4);
  }
}

TEST(SimulatedOuster, ItsImuReplacesThatOfTheRobotWithTheSameErrors) {
  for (const NamedRobot& named : kRobots) {
    const SensorChoice choice{.lidars = 2, .model = OusterModel::os1_32, .imperfections = {.imu_late_ms = 5}};
    const Robot robot = named.make(choice, 1);
    EXPECT_FALSE(robot.sensors.imu) << named.name;
    for (const NamedLidar& lidar : robot.sensors.lidars) {
      ASSERT_TRUE(lidar.imu) << named.name;
      EXPECT_EQ(lidar.imu->stamps.late, milliseconds{5}) << named.name;
      EXPECT_GT(lidar.imu->gyro_noise_radps, 0) << named.name;
    }
    EXPECT_EQ(robot.sensors.lidars[0].options.port, 7502);
    EXPECT_EQ(robot.sensors.lidars[1].options.port, 7504);
    EXPECT_EQ(robot.sensors.lidars[1].options.imu_port, 7505);
  }
}

TEST(SimulatedOuster, CaptureHasMetadataAndImuPacketsInPlaceOfImuCsv) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "simulated_ouster";
  std::filesystem::remove_all(folder);
  const Scene scene = room();
  const Trajectory trajectory(room_course(seconds{2}, 1.0), room_start());
  write_capture_folder(folder, scene, trajectory, seconds{1},
                       {.lidars = {{.name = "top", .options = ouster(), .imu = ImuFaults{}}}, .imu = {}});
  EXPECT_FALSE(std::filesystem::exists(folder / "imu.csv"));
  const auto metadata = ouster::read_metadata(folder / "top.json");
  ASSERT_TRUE(metadata) << metadata.error();
  auto capture = Capture::open(folder / "lidar.pcap");
  ASSERT_TRUE(capture) << capture.error();
  std::map<int, int> packets;
  Stamp last;
  while (const Datagram* datagram = capture->next()) {
    EXPECT_GE(datagram->receive_stamp, last);
    last = datagram->receive_stamp;
    ++packets[datagram->destination_port];
  }
  EXPECT_NEAR(packets[7502], 640, 1);
  EXPECT_EQ(packets[7503], 101); // both ends
  std::filesystem::remove_all(folder);
}

} // namespace
} // namespace locus::sim
