// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/base/pose.hpp"
#include "drivers/lidar_input.hpp"
#include "support/test_data.hpp"

namespace locus::hesai {
namespace {

class HesaiCalibration : public testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() /
            (std::string{"locus_hesai_"} + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
  }
  void TearDown() override { std::filesystem::remove(path_); }

  Expected<Calibration, std::string> read(const std::string& text) {
    std::ofstream{path_} << text;
    return read_calibration(path_);
  }
  void expect_error(const std::string& text, const std::string& where, const std::string& what) {
    const auto result = read(text);
    ASSERT_FALSE(result) << text;
    EXPECT_TRUE(result.error().starts_with(path_.string() + ":" + where)) << result.error();
    EXPECT_NE(result.error().find(what), std::string::npos) << result.error();
  }

  std::filesystem::path path_;
};

const std::string kHead = "Laser id,Elevation,Azimuth\n";

TEST_F(HesaiCalibration, AnglesAreThoseOfTheirLaser) {
  const auto calibration = read(kHead + "2,-10,1.5\n1,20.25,-2\n");
  ASSERT_TRUE(calibration) << calibration.error();
  ASSERT_EQ(calibration->laser_count, 2U);
  EXPECT_DOUBLE_EQ(calibration->storage[0].elevation_rad, 20.25 * kRadPerDeg);
  EXPECT_DOUBLE_EQ(calibration->storage[0].azimuth_offset_rad, -2.0 * kRadPerDeg);
  EXPECT_DOUBLE_EQ(calibration->storage[1].elevation_rad, -10.0 * kRadPerDeg);
  EXPECT_EQ(calibration->storage[0].ring, 1);
  EXPECT_EQ(calibration->storage[1].ring, 0);
}

TEST_F(HesaiCalibration, AllFormsOfTheFileAreRead) {
  for (const std::string text :
       {"Channel,Elevation,Azimuth\n1,1,2\n2,0,2\n", "EEFF,1,1\nChannel,Elevation,Azimuth\n1,1,2\n2,0,2\n",
        "Laser id,Elevation,Azimuth\r\n1, 1, 2\r\n2,0,2\r\n\r\n",
        "\xEF\xBB\xBFLaser id,Elevation,Azimuth\n1,1,2\n2,0,2",
        "Channel,Elevation,Azimuth\n1,1,2\n2,0,2\n0123456789abcdef0123456789abcdef,,\n"}) {
    const auto calibration = read(text);
    ASSERT_TRUE(calibration) << calibration.error();
    EXPECT_EQ(calibration->laser_count, 2U) << text;
    EXPECT_DOUBLE_EQ(calibration->storage[0].elevation_rad, kRadPerDeg);
  }
}

TEST_F(HesaiCalibration, ErrorsNameTheirLine) {
  expect_error("", " ", "no lasers in it");
  expect_error(kHead, " ", "no lasers in it");
  expect_error("lasers: []\n", "1: ", "\"Laser id,Elevation,Azimuth\" is expected");
  expect_error(kHead + "1,0,0\n1,0,0\n", "3: ", "laser 1 is there twice");
  expect_error(kHead + "1,0,0\n3,0,0\n", " ", "laser 2 is missing");
  expect_error(kHead + "0,0,0\n", "2: ", "laser 0");
  expect_error(kHead + "129,0,0\n", "2: ", "laser 129");
  expect_error(kHead + "1,nan,0\n", "2: ", "must be a number from -90 to 90");
  expect_error(kHead + "1,inf,0\n", "2: ", "must be a number from -90 to 90");
  expect_error(kHead + "1,91,0\n", "2: ", "must be a number from -90 to 90");
  expect_error(kHead + "1,0,1e9\n", "2: ", "Azimuth one from -180 to 180");
  expect_error(kHead + "1,0,x\n", "2: ", "Azimuth one from -180 to 180");
  expect_error(kHead + "1,0\n", "2: ", "a laser, its elevation and its azimuth are expected");
  expect_error(kHead + "1,0,0\nabcd\n2,0,0\n", "4: ", "laser 2");
  expect_error(kHead + std::string(200'000, '\n'), " ", "too long");
  const auto missing = read_calibration("/nowhere/angles.csv");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().find("/nowhere/angles.csv: cannot be read"), std::string::npos);
}

TEST_F(HesaiCalibration, OfAnotherNumberOfLasersIsRejected) {
  std::ofstream{path_} << kHead + "1,0,0\n";
  LidarOptions options;
  options.calibration = path_.string();
  options.hesai = Model::xt32;
  const auto refused = LidarInput::open(options, 0);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("1 lasers, but the lidar is a XT32"), std::string::npos) << refused.error();
  options.hesai.reset();
  const auto taken = LidarInput::open(options, 0);
  ASSERT_TRUE(taken) << taken.error();
  EXPECT_NE(taken->decoder().hesai(), nullptr) << "such a file is one of Hesai's";
}

/// The design values are close to the measured ones of a unit: a wrong order of the lasers would be degrees off.
TEST_F(HesaiCalibration, OfRealUnitsAreNearTheBuiltInTables) {
  const auto folder = test::test_data() / "hesai/calibration";
  if (!std::filesystem::exists(folder))
    GTEST_SKIP() << folder << " is not there; LOCUS_TEST_DATA names the folder of the real captures";
  for (const auto& [name, model] : {std::pair{"Pandar40P", Model::pandar40p},
                                    {"Pandar64", Model::pandar64},
                                    {"PandarQT64", Model::qt64},
                                    {"PandarXT16", Model::xt16},
                                    {"PandarXT32", Model::xt32},
                                    {"PandarXT32M", Model::xt32m},
                                    {"PandarQT128", Model::qt128}}) {
    const auto unit = read_calibration(folder / (std::string{name} + ".csv"));
    ASSERT_TRUE(unit) << unit.error();
    const Calibration& built_in = spec(model).calibration;
    ASSERT_EQ(unit->laser_count, built_in.laser_count) << name;
    for (std::size_t i = 0; i < unit->laser_count; ++i) {
      EXPECT_NEAR(unit->storage[i].elevation_rad, built_in.storage[i].elevation_rad, 0.2 * kRadPerDeg) << name << i;
      EXPECT_NEAR(unit->storage[i].azimuth_offset_rad, built_in.storage[i].azimuth_offset_rad, 0.2 * kRadPerDeg)
          << name << i;
      EXPECT_EQ(unit->storage[i].ring, built_in.storage[i].ring) << name << i;
    }
  }
}

} // namespace
} // namespace locus::hesai
