// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/lidar_input.hpp"
#include "drivers/velodyne/calibration.hpp"

namespace locus::velodyne {
namespace {

class CalibrationFile : public testing::Test {
 protected:
  void SetUp() override {
    path_ =
        std::filesystem::temp_directory_path() /
        (std::string{"locus_calibration_"} + testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml");
  }
  void TearDown() override { std::filesystem::remove(path_); }

  Expected<Calibration, std::string> read(const std::string& text) {
    std::ofstream{path_} << text;
    return read_calibration(path_);
  }
  void expect_error(const std::string& text, int line, const std::string& what) {
    const auto result = read(text);
    ASSERT_FALSE(result) << text;
    EXPECT_NE(result.error().find(path_.string() + ":" + std::to_string(line) + ":"), std::string::npos)
        << result.error();
    EXPECT_NE(result.error().find(what), std::string::npos) << result.error();
  }

  std::filesystem::path path_;
};

const std::string kTwoLasers = "lasers:\n"
                               "- {laser_id: 1, rot_correction: 0.1, vert_correction: 0.2, dist_correction: 0.03,\n"
                               "   vert_offset_correction: 0.01, horiz_offset_correction: 0.02, focal_distance: 0.0}\n"
                               "- {laser_id: 0, vert_correction: -0.2, two_pt_correction_available: false}\n"
                               "num_lasers: 2\n"
                               "distance_resolution: 0.004\n";

TEST_F(CalibrationFile, CorrectionsBecomeTheGeometryOfTheirLaser) {
  const auto calibration = read(kTwoLasers);
  ASSERT_TRUE(calibration) << calibration.error();
  ASSERT_EQ(calibration->lasers().size(), 2U);
  EXPECT_DOUBLE_EQ(calibration->distance_resolution_m, 0.004);
  const Laser& laser = calibration->lasers()[1];
  EXPECT_DOUBLE_EQ(laser.elevation_rad, 0.2);
  EXPECT_DOUBLE_EQ(laser.azimuth_offset_rad, -0.1);
  EXPECT_DOUBLE_EQ(laser.range_offset_m, 0.03);
  EXPECT_DOUBLE_EQ(laser.vertical_offset_m, 0.01 * std::cos(0.2));
  EXPECT_DOUBLE_EQ(laser.radial_offset_m, -0.01 * std::sin(0.2));
  EXPECT_DOUBLE_EQ(laser.lateral_offset_m, 0.02);
  EXPECT_EQ(laser.ring, 1);
  EXPECT_EQ(calibration->lasers()[0].ring, 0);
}

TEST_F(CalibrationFile, ErrorsNameTheLine) {
  expect_error("lasers: []\n", 1, "num_lasers is missing");
  expect_error("# nothing here\nnum_lasers: 2\n", 2, "no list of lasers");
  expect_error("lasers:\n- {laser_id: 0, vert_correction: 0}\nnum_lasers: 2\n", 2, "there are 1 lasers");
  expect_error("lasers:\n- {laser_id: 0, vert_correction: 0}\n- {laser_id: 0, vert_correction: 1}\nnum_lasers: 2\n", 3,
               "twice");
  expect_error("lasers:\n- {laser_id: 1, vert_correction: 0}\nnum_lasers: 1\n", 2, "laser_id must be");
  expect_error("lasers:\n- {laser_id: 0}\nnum_lasers: 1\n", 2, "vert_correction is missing");
  expect_error("lasers:\n- laser_id: 0\n  vert_correction: high\nnum_lasers: 1\n", 3, "must be a finite number");
  expect_error("lasers:\n- laser_id: 0\n  vert_correction: .nan\nnum_lasers: 1\n", 3, "must be a finite number");
  expect_error("lasers:\n- {laser_id: 0, vert_correction: 0}\nnum_lasers: 1\ndistance_resolution: -1\n", 4, "above 0");
  expect_error("lasers:\n- {laser_id: 0, vert_correction: 0,\n   two_pt_correction_available: true}\nnum_lasers: 1\n",
               3, "HDL-64E");
  expect_error("lasers:\n- 3\nnum_lasers: 1\n", 2, "map");
  expect_error("lasers: [\n", 2, "");
}

TEST_F(CalibrationFile, MissingFileIsNamed) {
  const auto result = read_calibration(path_);
  ASSERT_FALSE(result);
  EXPECT_TRUE(result.error().starts_with(path_.string() + ": cannot be read; give ")) << result.error();
}

TEST_F(CalibrationFile, FileForAnotherModelIsAnError) {
  ASSERT_TRUE(read(kTwoLasers));
  LidarOptions options;
  options.model = Model::vlp16;
  options.calibration = path_.string();
  const auto lidar = LidarInput::open(options, 0);
  ASSERT_FALSE(lidar);
  EXPECT_EQ(lidar.error(), "lidars.front.calibration: " + path_.string() + ": 2 lasers, but the lidar is a VLP-16");
}

} // namespace
} // namespace locus::velodyne
