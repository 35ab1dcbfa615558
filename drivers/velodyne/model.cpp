// SPDX-License-Identifier: Apache-2.0
#include "drivers/velodyne/model.hpp"

#include <algorithm>

#include "core/base/pose.hpp"
#include "drivers/spinning.hpp"

namespace locus::velodyne {

namespace {

using std::chrono::nanoseconds;

// VLP-16 user manual 63-9243, table 9-1: lasers in firing order, vertical corrections in millimetres.
constexpr std::array<double, 16> kVlp16ElevationDeg{-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
constexpr std::array<double, 16> kVlp16VerticalMm{11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1,
                                                  5.1,  -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2};
constexpr std::array<double, 16> kHiResElevationDeg{-10.00, 0.67, -8.67, 2.00, -7.33, 3.33, -6.00, 4.67,
                                                    -4.67,  6.00, -3.33, 7.33, -2.00, 8.67, -0.67, 10.00};
constexpr std::array<double, 16> kHiResVerticalMm{7.4, -0.9, 6.5, -1.8, 5.5, -2.7, 4.6, -3.7,
                                                  3.7, -4.6, 2.7, -5.5, 1.8, -6.5, 0.9, -7.4};

// VLP-32C user manual 63-9325, tables 9-2 and 9-6.
constexpr std::array<double, 32> kVlp32cElevationDeg{-25.000, -1.000, -1.667, -15.639, -11.310, 0.000,  -0.667, -8.843,
                                                     -7.254,  0.333,  -0.333, -6.148,  -5.333,  1.333,  0.667,  -4.000,
                                                     -4.667,  1.667,  1.000,  -3.667,  -3.333,  3.333,  2.333,  -2.667,
                                                     -3.000,  7.000,  4.667,  -2.333,  -2.000,  15.000, 10.333, -1.333};
constexpr std::array<double, 32> kVlp32cAzimuthDeg{1.4,  -4.2, 1.4,  -1.4, 1.4,  -1.4, 4.2,  -1.4, 1.4,  -4.2, 1.4,
                                                   -1.4, 4.2,  -1.4, 4.2,  -1.4, 1.4,  -4.2, 1.4,  -4.2, 4.2,  -1.4,
                                                   1.4,  -1.4, 1.4,  -1.4, 1.4,  -4.2, 4.2,  -1.4, 1.4,  -1.4};

// HDL-32E user manual 63-9113: even lasers rise from -30.67 deg, odd ones from -9.33 deg, in steps of 4/3 deg.
constexpr std::array<double, 32> kHdl32eElevationDeg{-30.67, -9.33, -29.33, -8.00, -28.00, -6.67, -26.67, -5.33,
                                                     -25.33, -4.00, -24.00, -2.67, -22.67, -1.33, -21.33, 0.00,
                                                     -20.00, 1.33,  -18.67, 2.67,  -17.33, 4.00,  -16.00, 5.33,
                                                     -14.67, 6.67,  -13.33, 8.00,  -12.00, 9.33,  -10.67, 10.67};

// VLS-128 user manual 63-9483, figure 9-8.
constexpr std::array<double, 128> kVls128ElevationDeg{
    -11.742, -1.99, 3.40,  -5.29,  -0.78, 4.61,  -4.08,  1.31,    -6.50, -1.11,   4.28,   -4.41, 0.10,    6.48,  -3.20,
    2.19,    -3.86, 1.53,  -9.244, -1.77, 2.74,  -5.95,  -0.56,   4.83,  -2.98,   2.41,   -6.28, -0.89,   3.62,  -5.07,
    0.32,    7.58,  -0.34, 5.18,   -3.64, 1.75,  -25.00, -2.43,   2.96,  -5.73,   0.54,   9.70,  -2.76,   2.63,  -7.65,
    -1.55,   3.84,  -4.85, 3.18,   -5.51, -0.12, 5.73,   -4.30,   1.09,  -16.042, -2.21,  4.06,  -4.63,   0.76,  15.00,
    -3.42,   1.97,  -6.85, -1.33,  -5.62, -0.23, 5.43,   -3.53,   0.98,  -19.582, -2.32,  3.07,  -4.74,   0.65,  11.75,
    -2.65,   1.86,  -7.15, -1.44,  3.95,  -2.10, 3.29,   -5.40,   -0.01, 4.50,    -4.19,  1.20,  -13.565, -1.22, 4.17,
    -4.52,   0.87,  6.08,  -3.31,  2.08,  -6.65, 1.42,   -10.346, -1.88, 3.51,    -6.06,  -0.67, 4.72,    -3.97, 2.30,
    -6.39,   -1.00, 4.39,  -5.18,  0.21,  6.98,  -3.09,  4.98,    -3.75, 1.64,    -8.352, -2.54, 2.85,    -5.84, -0.45,
    8.43,    -2.87, 2.52,  -6.17,  -1.66, 3.73,  -4.96,  0.43};
// Azimuth offsets, the same for every group of eight. The manual prints them with the opposite sign; Velodyne's own
// viewer, the ROS driver and Autoware, all tested on real units, agree on this one.
constexpr std::array<double, 8> kVls128AzimuthDeg{6.354, 4.548, 2.732, 0.911, -0.911, -2.732, -4.548, -6.354};

template <std::size_t Count>
Calibration calibration(const std::array<double, Count>& elevation_deg, double distance_resolution_m) {
  Calibration result;
  result.laser_count = Count;
  result.distance_resolution_m = distance_resolution_m;
  for (std::size_t i = 0; i < Count; ++i)
    result.storage[i].elevation_rad = elevation_deg[i] * kRadPerDeg;
  result.assign_rings();
  return result;
}

/// Builds the firings of one column, `offset_ns(i)` nanoseconds after its first, with lasers in cyclic order.
template <class Offset> std::array<Firing, kMaxLasers> firings(std::size_t lasers, Offset offset_ns) {
  std::array<Firing, kMaxLasers> result{};
  for (std::size_t i = 0; i < kMaxLasers; ++i)
    result[i] = {static_cast<std::int32_t>(offset_ns(i)), static_cast<std::uint8_t>(i % lasers)};
  return result;
}

/// VLP-16 and Puck Hi-Res: a block holds two sequences of 16 lasers, 55.296 us apart; one laser every 2.304 us.
ModelSpec puck(std::string_view name, std::uint8_t product_id, const std::array<double, 16>& elevation_deg,
               const std::array<double, 16>& vertical_mm) {
  ModelSpec result{name,
                   product_id,
                   1,
                   nanoseconds{110'592},
                   nanoseconds{0},
                   firings(16, [](std::size_t i) { return 55'296 * (i / 16) + 2'304 * (i % 16); }),
                   calibration(elevation_deg, 0.002)};
  for (std::size_t i = 0; i < vertical_mm.size(); ++i)
    result.calibration.storage[i].vertical_offset_m = 0.001 * vertical_mm[i];
  return result;
}

/// VLP-32C: pairs of lasers, one pair every 2.304 us.
ModelSpec vlp32c() {
  ModelSpec result{"VLP-32C",
                   0x28,
                   1,
                   nanoseconds{55'296},
                   nanoseconds{0},
                   firings(32, [](std::size_t i) { return 2'304 * (i / 2); }),
                   calibration(kVlp32cElevationDeg, 0.004)};
  for (std::size_t i = 0; i < kVlp32cAzimuthDeg.size(); ++i)
    result.calibration.storage[i].azimuth_offset_rad = kVlp32cAzimuthDeg[i] * kRadPerDeg;
  return result;
}

/// HDL-32E: one laser every 1.152 us.
ModelSpec hdl32e() {
  return {"HDL-32E",
          0x21,
          1,
          nanoseconds{46'080},
          nanoseconds{0},
          firings(32, [](std::size_t i) { return 1'152 * i; }),
          calibration(kHdl32eElevationDeg, 0.002)};
}

/// VLS-128: groups of eight lasers, a maintenance slot after the eighth group and a longer pause after the sixteenth.
/// The time in the packet is that of the fourth group, 8.7 us after the first. The manual (63-9483, chapter 9) gives
/// one group every 2.665 us and one column every 53.3 us.
///
/// Firmware 5.2.3.0 and later fires one group every 2.89 us: Rev. 4 of the manual, as quoted by the decoder
/// github.com/valgur/velodyne_decoder (packet_decoder.cpp); three of these are the 8.7 us. The column duration at this
/// pace was measured: 165.83 us per packet of three columns, mean of 2192 packets, in the recording of a unit of April
/// 2020.
ModelSpec vls128(Pace pace) {
  const bool slower = pace == Pace::slower;
  const std::size_t slot_ns = slower ? 2'890 : 2'665;
  ModelSpec result{"VLS-128",
                   0xA1,
                   4,
                   nanoseconds{slower ? 55'277 : 53'300},
                   nanoseconds{8'700},
                   firings(128, [=](std::size_t i) { return slot_ns * (i / 8 + i / 64); }),
                   calibration(kVls128ElevationDeg, 0.004)};
  for (std::size_t i = 0; i < kMaxLasers; ++i)
    result.calibration.storage[i].azimuth_offset_rad = kVls128AzimuthDeg[i % 8] * kRadPerDeg;
  return result;
}

} // namespace

void Calibration::assign_rings() { number_rings(std::span{storage}.first(laser_count)); }

const ModelSpec& spec(Model model, Pace pace) {
  static const ModelSpec slower_vls128 = vls128(Pace::slower);
  if (model == Model::vls128 && pace == Pace::slower)
    return slower_vls128;
  static const std::array<ModelSpec, kModels.size()> specs{
      puck("VLP-16", 0x22, kVlp16ElevationDeg, kVlp16VerticalMm),
      puck("Puck-Hi-Res", 0x24, kHiResElevationDeg, kHiResVerticalMm), vlp32c(), hdl32e(), vls128(Pace::first)};
  return specs[static_cast<std::size_t>(model)];
}

std::string_view to_string(Model model) { return spec(model).name; }

std::optional<Model> model_from_string(std::string_view name) {
  const auto* found = std::find_if(kModels.begin(), kModels.end(), [&](Model m) { return spec(m).name == name; });
  return found == kModels.end() ? std::nullopt : std::optional{*found};
}

std::optional<Model> model_from_product_id(std::uint8_t product_id) {
  const auto* found =
      std::find_if(kModels.begin(), kModels.end(), [&](Model m) { return spec(m).product_id == product_id; });
  return found == kModels.end() ? std::nullopt : std::optional{*found};
}

std::string_view to_string(ReturnMode mode) {
  switch (mode) {
  case ReturnMode::strongest:
    return "strongest";
  case ReturnMode::last:
    return "last";
  case ReturnMode::dual:
    return "dual";
  }
  return "unknown";
}

std::optional<ReturnMode> return_mode_from_byte(std::uint8_t byte) {
  const auto mode = static_cast<ReturnMode>(byte);
  if (mode == ReturnMode::strongest || mode == ReturnMode::last || mode == ReturnMode::dual)
    return mode;
  return std::nullopt;
}

PacketLayout packet_layout(Model model, ReturnMode mode) {
  const std::size_t banks = spec(model).banks;
  const std::size_t returns = mode == ReturnMode::dual ? 2 : 1;
  return {banks, returns, kBlocks / (banks * returns)};
}

Duration packet_duration(Model model, ReturnMode mode, Pace pace) {
  return static_cast<Duration::rep>(packet_layout(model, mode).columns) * spec(model, pace).column_duration;
}

} // namespace locus::velodyne
