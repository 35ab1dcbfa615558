// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/ouster_sensor.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "locus_sim/dice.hpp"

namespace locus::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kColumns = 1024, kColumnsPerPacket = 16;

// OS1, Rev 7 data sheet: 42.4 degrees from the uppermost beam to the lowest; four beams side by side.
constexpr double kUppermost_deg = 21.2;
constexpr std::array kAside_deg{4.2, 1.4, -1.4, -4.2};
constexpr double kBeamOrigin_mm = 15.806;

std::vector<double> altitudes_deg(std::size_t beams) {
  std::vector<double> all;
  for (std::size_t i = 0; i < beams; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(beams - 1);
    all.push_back(std::round(100 * kUppermost_deg * (1 - 2 * share)) / 100); // rounded to two digits, as in the files
  }
  return all;
}

std::vector<double> azimuths_deg(std::size_t beams) {
  std::vector<double> all;
  for (std::size_t i = 0; i < beams; ++i)
    all.push_back(kAside_deg[i % kAside_deg.size()]);
  return all;
}

std::vector<int> pixel_shifts(std::size_t beams) {
  std::vector<int> all;
  for (const double aside_deg : azimuths_deg(beams))
    all.push_back(static_cast<int>(std::lround(aside_deg / 360 * kColumns)));
  return all;
}

/// Builds the metadata as served by http://SENSOR/api/v1/sensor/metadata, firmware 2.5.
ordered_json metadata_of(const SyntheticLidarOptions& options, std::size_t beams) {
  constexpr std::uint64_t kFirstSerial = 122'301'000'000, kInitIds = 0xFFFFFF;
  const std::uint64_t draw = seed_for(options.seed, "serial number");
  return {
      {"sensor_info",
       {{"prod_line", fmt::format("OS-1-{}", beams)},
        {"prod_sn", std::to_string(kFirstSerial + draw % 1'000'000)},
        {"image_rev", "ousteros-image-prod-bootes-v2.5.2"},
        {"build_rev", "v2.5.2"},
        {"initialization_id", seed_for(options.seed, "initialization") % kInitIds + 1},
        {"status", "RUNNING"}}},
      {"beam_intrinsics",
       {{"beam_altitude_angles", altitudes_deg(beams)},
        {"beam_azimuth_angles", azimuths_deg(beams)},
        {"lidar_origin_to_beam_origin_mm", kBeamOrigin_mm},
        {"beam_to_lidar_transform", {1, 0, 0, kBeamOrigin_mm, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}},
      {"imu_intrinsics", {{"imu_to_sensor_transform", {1, 0, 0, 6.253, 0, 1, 0, -11.775, 0, 0, 1, 7.645, 0, 0, 0, 1}}}},
      {"lidar_intrinsics", {{"lidar_to_sensor_transform", {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 38.195, 0, 0, 0, 1}}}},
      {"lidar_data_format",
       {{"columns_per_frame", kColumns},
        {"columns_per_packet", kColumnsPerPacket},
        {"column_window", {0, kColumns - 1}},
        {"pixels_per_column", beams},
        {"pixel_shift_by_row", pixel_shifts(beams)},
        {"udp_profile_lidar", "RNG19_RFL8_SIG16_NIR16"},
        {"udp_profile_imu", "LEGACY"},
        {"fps", 10}}},
      {"calibration_status", {{"reflectivity", {{"valid", true}}}}},
      {"config_params",
       {{"lidar_mode", fmt::format("{}x10", kColumns)},
        {"timestamp_mode", "TIME_FROM_INTERNAL_OSC"},
        {"udp_port_lidar", options.port},
        {"udp_port_imu", options.imu_port},
        {"udp_profile_lidar", "RNG19_RFL8_SIG16_NIR16"},
        {"udp_profile_imu", "LEGACY"},
        {"operating_mode", "NORMAL"}}}};
}

} // namespace

OusterSensor::OusterSensor(const SyntheticLidarOptions& options, Stamp start) : start_(start), drift_(options.drift) {
  constexpr double kShortest_s = 30, kLongest_s = 3600;
  switched_on_ = start - from_seconds(Dice(seed_for(options.seed, "switched on")).between(kShortest_s, kLongest_s));
  text_ = metadata_of(options, static_cast<std::size_t>(std::get<OusterModel>(options.model))).dump(2) + '\n';
  auto metadata = ouster::parse_metadata(text_);
  if (!metadata)
    throw std::logic_error("the metadata of a simulated Ouster: " + metadata.error());
  metadata_ = *metadata;
}

Duration OusterSensor::shown_at_true(Stamp stamp) const {
  const auto passed_ns = static_cast<double>((stamp - start_).count());
  return shown_at(stamp) + Duration{std::llround(passed_ns * drift_)};
}

} // namespace locus::sim
