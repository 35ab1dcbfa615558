// SPDX-License-Identifier: Apache-2.0
#include "drivers/ouster/metadata.hpp"

#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace locus::ouster {
namespace {

using nlohmann::json;

/// Returns metadata as sent by recent firmware.
json nested() {
  const std::vector<double> mm{-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 38.195, 0, 0, 0, 1};
  const std::vector<double> imu_mm{1, 0, 0, -2.441, 0, 1, 0, -9.725, 0, 0, 1, 7.533, 0, 0, 0, 1};
  const std::vector<double> beam_mm{1, 0, 0, 27.116, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1};
  std::vector<double> altitude, azimuth;
  for (int i = 0; i < 32; ++i) {
    altitude.push_back(20.0 - i);
    azimuth.push_back(i % 2 == 0 ? 1.5 : -1.5);
  }
  return {{"sensor_info", {{"prod_line", "OS-0-32"}, {"prod_sn", "122247000785"}, {"initialization_id", 390078}}},
          {"config_params",
           {{"lidar_mode", "512x20"},
            {"timestamp_mode", "TIME_FROM_PTP_1588"},
            {"udp_port_lidar", 53750},
            {"udp_port_imu", 7513}}},
          {"beam_intrinsics",
           {{"beam_altitude_angles", altitude},
            {"beam_azimuth_angles", azimuth},
            {"lidar_origin_to_beam_origin_mm", 27.116},
            {"beam_to_lidar_transform", beam_mm}}},
          {"imu_intrinsics", {{"imu_to_sensor_transform", imu_mm}}},
          {"lidar_intrinsics", {{"lidar_to_sensor_transform", mm}}},
          {"lidar_data_format",
           {{"pixels_per_column", 32},
            {"columns_per_packet", 16},
            {"columns_per_frame", 512},
            {"column_window", {384, 127}},
            {"udp_profile_lidar", "RNG19_RFL8_SIG16_NIR16_DUAL"},
            {"udp_profile_imu", "LEGACY"}}},
          {"calibration_status", {{"reflectivity", {{"valid", true}}}}}};
}

/// Returns the same metadata in the format of older clients.
json flat() {
  json root = nested();
  json result = root["beam_intrinsics"];
  for (const char* const section : {"sensor_info", "config_params", "imu_intrinsics", "lidar_intrinsics"})
    result.update(root[section]);
  result["data_format"] = root["lidar_data_format"];
  return result;
}

void expect_refused(const json& file, const std::string& why) {
  const auto metadata = parse_metadata(file.dump());
  ASSERT_FALSE(metadata) << why;
  EXPECT_EQ(metadata.error(), why);
}

TEST(OusterMetadata, IsReadInBothForms) {
  for (const json& file : {nested(), flat()}) {
    const auto metadata = parse_metadata(file.dump());
    ASSERT_TRUE(metadata) << metadata.error();
    EXPECT_EQ(metadata->product_line, "OS-0-32");
    EXPECT_EQ(metadata->serial_number, 122'247'000'785U);
    EXPECT_EQ(metadata->init_id, 390'078U);
    EXPECT_EQ(metadata->profile, Profile::rng19_dual);
    EXPECT_EQ(metadata->columns_per_frame, 512U);
    EXPECT_EQ(metadata->frames_per_s, 20);
    EXPECT_EQ(metadata->columns_per_packet, 16U);
    EXPECT_EQ(metadata->pixels_per_column, 32U);
    EXPECT_EQ(metadata->first_column, 384U);
    EXPECT_EQ(metadata->last_column, 127U);
    EXPECT_EQ(metadata->columns_in_window(), 256U) << "it goes round the end of the turn";
    EXPECT_DOUBLE_EQ(metadata->altitude_rad[1], 19.0 * kRadPerDeg);
    EXPECT_DOUBLE_EQ(metadata->azimuth_rad[1], -1.5 * kRadPerDeg);
    EXPECT_DOUBLE_EQ(metadata->beam_origin_radius_m, 0.027116);
    EXPECT_DOUBLE_EQ(metadata->beam_origin_height_m, 0.0005);
    EXPECT_TRUE(
        (metadata->T_sensor_lidar * Eigen::Vector3d{1, 2, 3}).isApprox(Eigen::Vector3d{-1, -2, 3.038195}, 1e-12));
    EXPECT_TRUE(metadata->T_sensor_imu.translation.isApprox(Eigen::Vector3d{-0.002441, -0.009725, 0.007533}));
    EXPECT_EQ(metadata->timestamp_mode, TimestampMode::ptp_1588);
    EXPECT_EQ(metadata->lidar_port, 53750);
    EXPECT_EQ(metadata->imu_port, 7513);
  }
}

TEST(OusterMetadata, OfOldFirmwareHasTheMakersDefaults) {
  json file{{"beam_altitude_angles", std::vector<double>(64, 1.0)},
            {"beam_azimuth_angles", std::vector<double>(64, 2.0)},
            {"lidar_mode", "2048x10"},
            {"prod_line", "OS-1-64"}};
  const auto metadata = parse_metadata(file.dump());
  ASSERT_TRUE(metadata) << metadata.error();
  EXPECT_EQ(metadata->profile, Profile::legacy);
  EXPECT_EQ(metadata->pixels_per_column, 64U);
  EXPECT_EQ(metadata->packet_format().packet_bytes, 12608U);
  EXPECT_EQ(metadata->columns_in_window(), 2048U);
  EXPECT_EQ(metadata->serial_number, 0U);
  EXPECT_EQ(metadata->init_id, 0U);
  EXPECT_DOUBLE_EQ(metadata->beam_origin_radius_m, 0.015806);
  EXPECT_DOUBLE_EQ(metadata->T_sensor_lidar.translation.z(), 0.03618);
  EXPECT_DOUBLE_EQ(metadata->T_sensor_imu.translation.x(), 0.006253);
  EXPECT_EQ(metadata->timestamp_mode, TimestampMode::unknown);
  EXPECT_EQ(metadata->lidar_port, 7502);
  EXPECT_EQ(metadata->imu_port, 7503);
}

TEST(OusterMetadata, IsRejectedWithTheKey) {
  const auto changed = [](const std::function<void(json&)>& change) {
    json file = nested();
    change(file);
    return file;
  };
  const auto without = [](const std::string& section, const std::string& key) {
    json file = nested();
    file[section].erase(key);
    return file;
  };
  expect_refused(json::array(), "not the metadata of an Ouster sensor: no keys at all");
  expect_refused(json::object(), "beam_altitude_angles: is missing; this is not the metadata of an Ouster sensor");
  expect_refused(without("beam_intrinsics", "beam_azimuth_angles"), "beam_intrinsics.beam_azimuth_angles: is missing");
  expect_refused(without("config_params", "lidar_mode"), "config_params.lidar_mode: is missing");
  expect_refused(without("lidar_data_format", "pixels_per_column"), "lidar_data_format.pixels_per_column: is missing");
  for (const char* const section : {"sensor_info", "beam_intrinsics", "imu_intrinsics", "lidar_intrinsics",
                                    "config_params", "lidar_data_format", "calibration_status"})
    expect_refused(changed([&](json& file) { file.erase(section); }),
                   std::string{section} + ": this section is missing");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_altitude_angles"].erase(0); }),
                 "beam_intrinsics.beam_altitude_angles: holds 31 numbers, but a column has 32 pixels");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_altitude_angles"][3] = "3"; }),
                 "beam_intrinsics.beam_altitude_angles: must hold finite numbers");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_altitude_angles"][3] = 91; }),
                 "beam_intrinsics.beam_altitude_angles: holds an angle beyond 90 degrees");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_altitude_angles"] = std::vector<int>(32, 0); }),
                 "beam_intrinsics.beam_altitude_angles: holds nothing but zeros: the sensor had not started when it "
                 "was asked");
  expect_refused(changed([](json& file) { file["config_params"]["lidar_mode"] = "512x"; }),
                 "config_params.lidar_mode: \"512x\" is no mode; one like 1024x10 is needed");
  expect_refused(changed([](json& file) { file["config_params"]["lidar_mode"] = "1024x20"; }),
                 "lidar_data_format.columns_per_frame: is 512, but config_params.lidar_mode says 1024");
  expect_refused(changed([](json& file) { file["config_params"]["udp_port_imu"] = 1e6; }),
                 "config_params.udp_port_imu: must be a whole number from 0 to 65535");
  expect_refused(changed([](json& file) {
                   file["lidar_data_format"]["column_window"] = {0, 512};
                 }),
                 "lidar_data_format.column_window: must hold columns from 0 to 511");
  for (const int pixels : {8, 40, 48, 80, 96, 112})
    expect_refused(changed([=](json& file) { file["lidar_data_format"]["pixels_per_column"] = pixels; }),
                   "lidar_data_format.pixels_per_column: must be 16, 32, 64 or 128");
  expect_refused(changed([](json& file) { file["sensor_info"]["prod_sn"] = "12x"; }),
                 "sensor_info.prod_sn: \"12x\" is not a serial number");
  expect_refused(changed([](json& file) { file["sensor_info"]["prod_line"] = 7; }),
                 "sensor_info.prod_line: must be text");
  expect_refused(changed([](json& file) { file["imu_intrinsics"]["imu_to_sensor_transform"][0] = 2; }),
                 "imu_intrinsics.imu_to_sensor_transform: is not a rotation and a translation");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_to_lidar_transform"][7] = 2; }),
                 "beam_intrinsics.beam_to_lidar_transform: is more than a shift outwards and upwards");
  expect_refused(changed([](json& file) { file["beam_intrinsics"]["beam_to_lidar_transform"][3] = 2000; }),
                 "beam_intrinsics.lidar_origin_to_beam_origin_mm: puts the origin of the beams outside the sensor");
}

TEST(OusterMetadata, NamesAnUnsupportedProfile) {
  json file = nested();
  file["lidar_data_format"]["udp_profile_lidar"] = "RNG23_RFL8";
  const auto metadata = parse_metadata(file.dump());
  ASSERT_FALSE(metadata);
  EXPECT_EQ(metadata.error(), "lidar_data_format.udp_profile_lidar: RNG23_RFL8 cannot be read; set the sensor to "
                              "one of " +
                                  known_profiles());
}

TEST(OusterMetadata, HeaderOfFunctionalSafetyIsSetByItsKeyOrByTheProfile) {
  json file = nested();
  EXPECT_FALSE(parse_metadata(file.dump())->safety_header);
  file["lidar_data_format"]["header_type"] = "FUSA";
  EXPECT_TRUE(parse_metadata(file.dump())->safety_header);
  file["lidar_data_format"].erase("header_type");
  file["lidar_data_format"]["udp_profile_lidar"] = "FUSA_RNG15_RFL8_NIR8_DUAL";
  EXPECT_TRUE(parse_metadata(file.dump())->safety_header);
}

TEST(OusterMetadata, WithoutImuPacketsHasNoPortForThem) {
  json file = nested();
  file["lidar_data_format"]["udp_profile_imu"] = "OFF";
  const auto metadata = parse_metadata(file.dump());
  ASSERT_TRUE(metadata) << metadata.error();
  EXPECT_EQ(metadata->imu_port, 0);
}

TEST(OusterMetadata, ReportsWhereTextIsNoJson) {
  EXPECT_EQ(parse_metadata("{\"a\": ]").error(), "is no JSON from byte 7 on");
  EXPECT_EQ(parse_metadata("").error(), "is no JSON from byte 1 on");
  const std::string text = nested().dump();
  for (std::size_t length = 0; length < text.size(); length += 7)
    EXPECT_FALSE(parse_metadata(text.substr(0, length))) << length;
}

TEST(OusterMetadata, ErrorsNameTheFile) {
  const auto file = std::filesystem::temp_directory_path() / "locus_ouster_metadata.json";
  std::filesystem::remove(file);
  EXPECT_NE(read_metadata(file).error().find("locusctl fetch SENSOR"), std::string::npos);
  std::ofstream{file} << "{}";
  EXPECT_EQ(read_metadata(file).error(), file.string() + ": beam_altitude_angles: is missing; this is not the metadata "
                                                         "of an Ouster sensor");
  std::ofstream{file} << nested().dump();
  EXPECT_TRUE(read_metadata(file));
  std::filesystem::remove(file);
}

} // namespace
} // namespace locus::ouster
