// SPDX-License-Identifier: Apache-2.0
#include "drivers/hesai/model.hpp"

#include "core/base/pose.hpp"
#include "drivers/spinning.hpp"
#include "drivers/wire.hpp"

// Sources of layouts, firing times and angles: Hesai's user manuals (section 3, "Data structure"; appendices "Channel
// distribution" and "Absolute time and laser firing time") and, where the available manuals lack a page, its SDK
// (github.com/HesaiTechnology/HesaiLidar_SDK_2.0: udp_protocol_*.h, correction/firetime_correction) and nebula
// (github.com/tier4/nebula: decoders/pandar_*.hpp, calibration), which quote them.
namespace locus::hesai {

namespace {

using std::chrono::nanoseconds;

using Degrees = std::array<double, kMaxChannels>;

Calibration calibration(std::size_t channels, const Degrees& elevation_deg, const Degrees& azimuth_deg) {
  Calibration result;
  result.laser_count = channels;
  for (std::size_t i = 0; i < channels; ++i) {
    result.storage[i].elevation_rad = elevation_deg[i] * kRadPerDeg;
    result.storage[i].azimuth_offset_rad = azimuth_deg[i] * kRadPerDeg;
  }
  result.assign_rings();
  return result;
}

/// Builds the design angles of the manual: equally spaced elevations, no azimuth offsets.
Calibration fan(std::size_t channels, double uppermost_deg, double step_deg) {
  Degrees elevation_deg{};
  for (std::size_t i = 0; i < channels; ++i)
    elevation_deg[i] = uppermost_deg - step_deg * static_cast<double>(i);
  return calibration(channels, elevation_deg, {});
}

/// Builds a sequence whose channels fire `offset_ns(i)` nanoseconds after the azimuth's instant.
template <class Offset>
FiringSequence sequence(nanoseconds column_duration, Offset offset_ns, std::uint8_t silent_banks = 0) {
  FiringSequence result{column_duration, {}, silent_banks};
  for (std::size_t i = 0; i < kMaxChannels; ++i)
    result.offset_ns[i] = static_cast<std::int32_t>(offset_ns(i));
  return result;
}

std::array<FiringSequence, 2> only(const FiringSequence& sequence) { return {sequence, sequence}; }

// Pandar40P, Pandar64 ---------------------------------------------------------------------------------------------

constexpr TailLayout kPandarTail{.return_mode = 14, .motor_speed = 8, .date = 16, .time = 10, .bytes = 22};

/// Pandar40P: the azimuth is that of the end of a block, so the lasers fire before it.
ModelSpec pandar40p() {
  constexpr std::array kAheadNs{42'220, 28'470, 16'040, 3'620,  45'490, 31'740, 47'460, 54'670, 20'620, 33'710,
                                40'910, 8'190,  20'620, 27'160, 50'730, 8'190,  14'740, 36'980, 45'490, 52'700,
                                23'890, 31'740, 38'950, 11'470, 18'650, 25'190, 48'760, 6'230,  12'770, 35'010,
                                21'920, 9'500,  43'520, 29'770, 17'350, 4'920,  42'220, 28'470, 16'040, 3'620};
  constexpr Degrees kElevationDeg{14.794, 10.944, 7.971,  4.969,   2.952,  1.94,    1.6,     1.263,   0.925,   0.587,
                                  0.249,  -0.088, -0.425, -0.763,  -1.101, -1.439,  -1.776,  -2.116,  -2.453,  -2.788,
                                  -3.128, -3.463, -3.8,   -4.138,  -4.473, -4.808,  -5.145,  -5.479,  -5.814,  -6.149,
                                  -7.151, -8.147, -9.148, -10.133, -11.12, -12.094, -13.062, -14.018, -18.977, -24.985};
  Degrees azimuth_deg; // channels 7 to 29 are in three rows
  azimuth_deg.fill(-1.042);
  for (std::size_t i = 6; i < 29; ++i)
    azimuth_deg[i] = std::array{3.125, -5.208, -1.042}[i % 3];
  const auto ahead = [&](std::size_t i) { return i < kAheadNs.size() ? -kAheadNs[i] : -kAheadNs[3]; };
  return {{},
          {0, 4, 3, 40, 10, false, kPandarTail},
          {1262, 1266},
          true,
          nanoseconds{-28'580},
          0.3F,
          SequenceFrom::only_one,
          only(sequence(nanoseconds{55'560}, ahead)),
          calibration(40, kElevationDeg, azimuth_deg)};
}

ModelSpec pandar64() {
  constexpr std::array kAheadNs{23'180, 21'876, 20'572, 19'268, 17'964, 16'660, 11'444, 46'796, 7'532,  36'956, 50'732,
                                54'668, 40'892, 44'828, 31'052, 34'988, 48'764, 52'700, 38'924, 42'860, 29'084, 33'020,
                                46'796, 25'148, 36'956, 50'732, 27'116, 40'892, 44'828, 31'052, 34'988, 48'764, 25'148,
                                38'924, 42'860, 29'084, 33'020, 52'700, 6'228,  54'668, 15'356, 27'116, 10'140, 23'180,
                                4'924,  21'876, 14'052, 17'964, 8'836,  19'268, 3'620,  20'572, 12'748, 16'660, 7'532,
                                11'444, 6'228,  15'356, 10'140, 4'924,  3'620,  14'052, 8'836,  12'748};
  constexpr Degrees kElevationDeg{
      14.9,   11.05,  8.077,  5.075,  3.058,  2.046,   1.878,   1.706,   1.54,    1.369,   1.202,   1.031,  0.864,
      0.693,  0.526,  0.355,  0.187,  0.018,  -0.151,  -0.319,  -0.49,   -0.657,  -0.827,  -0.995,  -1.166, -1.333,
      -1.504, -1.67,  -1.842, -2.01,  -2.18,  -2.347,  -2.518,  -2.682,  -2.855,  -3.022,  -3.192,  -3.357, -3.53,
      -3.694, -3.866, -4.032, -4.203, -4.367, -4.54,   -4.702,  -4.874,  -5.039,  -5.211,  -5.373,  -5.547, -5.708,
      -5.88,  -6.043, -7.045, -8.041, -9.042, -10.027, -11.014, -11.988, -12.956, -13.912, -18.871, -24.879};
  Degrees azimuth_deg; // channels 7 to 53 are in six rows
  azimuth_deg.fill(-1.042);
  for (std::size_t i = 6; i < 53; ++i)
    azimuth_deg[i] = std::array{1.042, 3.125, 5.208, -5.208, -3.125, -1.042}[i % 6];
  const auto ahead = [&](std::size_t i) { return i < kAheadNs.size() ? -kAheadNs[i] : -kAheadNs[50]; };
  return {{},
          {8, 2, 3, 64, 6, false, kPandarTail},
          {1194, 1198},
          true,
          nanoseconds{-42'580},
          0.3F,
          SequenceFrom::only_one,
          only(sequence(nanoseconds{55'560}, ahead)),
          calibration(64, kElevationDeg, azimuth_deg)};
}

// XT ----------------------------------------------------------------------------------------------------------------

constexpr TailLayout kXtTail{.return_mode = 10, .motor_speed = 11, .date = 13, .time = 19, .bytes = 24};

/// XT series: a firing round starts 5.632 us after its trigger, the first laser 0.368 us later.
ModelSpec xt(std::size_t channels, std::size_t blocks, std::size_t bytes, float least_range_m, std::size_t at_once,
             std::int32_t step_ns, const Calibration& angles) {
  const auto firing = [=](std::size_t i) { return 6'000 + step_ns * static_cast<std::int32_t>(i % at_once); };
  return {{6, 1},
          {12, 2, 4, channels, blocks, false, kXtTail},
          {bytes},
          true,
          nanoseconds{0},
          least_range_m,
          SequenceFrom::only_one,
          only(sequence(nanoseconds{50'000}, firing)),
          angles};
}

// QT64 --------------------------------------------------------------------------------------------------------------

/// QT64: groups of eight channels, 2.06 us from laser to laser, with a pause between groups. The manual counts these
/// times from 10 us before the azimuth's instant, as does the maker's SDK.
ModelSpec qt64() {
  constexpr TailLayout kTail{.return_mode = 16, .motor_speed = 10, .date = 18, .time = 12, .bytes = 24};
  constexpr std::array kFirstOfEightNs{2'310, 19'160, 36'610, 53'450, 70'900, 87'750, 105'200, 122'050};
  constexpr Degrees kElevationDeg{
      -52.121, -49.785, -47.577, -45.477, -43.465, -41.528, -39.653, -37.831, -36.055, -34.32,  -32.619,
      -30.95,  -29.308, -27.69,  -26.094, -24.517, -22.964, -21.42,  -19.889, -18.372, -16.865, -15.368,
      -13.88,  -12.399, -10.925, -9.457,  -7.994,  -6.535,  -5.079,  -3.626,  -2.175,  -0.725,  0.725,
      2.175,   3.626,   5.079,   6.534,   7.993,   9.456,   10.923,  12.397,  13.877,  15.365,  16.861,
      18.368,  19.885,  21.415,  22.959,  24.524,  26.101,  27.697,  29.315,  30.957,  32.627,  34.328,
      36.064,  37.84,   39.662,  41.537,  43.475,  45.487,  47.587,  49.795,  52.133};
  constexpr Degrees kAzimuthDeg{8.736,  8.314,  7.964,  7.669,  7.417,  7.198,  7.007,  6.838,  6.688,  6.554,  6.434,
                                6.326,  6.228,  6.14,   6.059,  5.987,  -5.27,  -5.216, -5.167, -5.123, -5.083, -5.047,
                                -5.016, -4.988, -4.963, -4.942, -4.924, -4.91,  -4.898, -4.889, -4.884, -4.881, 5.493,
                                5.496,  5.502,  5.512,  5.525,  5.541,  5.561,  5.584,  5.611,  5.642,  5.676,  5.716,
                                5.759,  5.808,  5.862,  5.921,  -5.33,  -5.396, -5.469, -5.55,  -5.64,  -5.74,  -5.85,
                                -5.974, -6.113, -6.269, -6.447, -6.651, -6.887, -7.163, -7.493, -7.892};
  const auto firing = [&](std::size_t i) { return kFirstOfEightNs[i / 8 % 8] + 2'057 * static_cast<int>(i % 8); };
  return {{3, 1},
          {12, 2, 4, 64, 4, false, kTail},
          {1072, 1068},
          false,
          nanoseconds{35'710},
          0.1F,
          SequenceFrom::only_one,
          only(sequence(nanoseconds{166'667}, firing)),
          calibration(64, kElevationDeg, kAzimuthDeg)};
}

// QT128, OT128 ------------------------------------------------------------------------------------------------------

constexpr TailLayout kLongTail{.return_mode = 12, .motor_speed = 13, .date = 15, .time = 21, .bytes = 26};

/// Firing times of the first sequence. Channels 65 to 128 fire in both sequences, 1 to 32 only in the second and 33 to
/// 64 only in the first.
constexpr std::array kQt128FirstNs{
    27'656,  53'000, 2'312,  78'344, 81'512, 5'480,  56'168, 30'824, 33'992, 59'336, 8'648,  84'680, 87'848, 11'816,
    62'504,  37'160, 40'328, 65'672, 14'984, 91'016, 94'184, 18'152, 68'840, 43'496, 46'664, 72'008, 21'320, 97'352,
    100'520, 24'488, 75'176, 49'832, 1'456,  77'488, 26'800, 52'144, 55'312, 29'968, 80'656, 4'624,  7'792,  83'824,
    33'136,  58'480, 61'648, 36'304, 86'992, 10'960, 14'128, 90'160, 39'472, 64'816, 67'984, 42'640, 93'328, 17'296,
    20'464,  96'496, 45'808, 71'152, 74'320, 48'976, 99'664, 23'632, 25'944, 51'288, 600,    76'632, 79'800, 3'768,
    54'456,  29'112, 32'280, 57'624, 6'936,  82'968, 86'136, 10'104, 60'792, 35'448, 38'616, 63'960, 13'272, 89'304,
    92'472,  16'440, 67'128, 41'784, 44'952, 70'296, 19'608, 95'640, 98'808, 22'776, 73'464, 48'120};

ModelSpec qt128() {
  constexpr Degrees kElevationDeg{
      -52.627, -51.028, -49.515, -48.074, -46.695, -45.369, -44.09,  -42.852, -41.651, -40.482, -39.343, -38.231,
      -37.143, -36.076, -35.03,  -34.002, -32.992, -31.996, -31.015, -30.048, -29.093, -28.149, -27.216, -26.292,
      -25.378, -24.473, -23.575, -22.685, -21.802, -20.926, -20.056, -19.191, -18.331, -17.477, -16.627, -15.781,
      -14.94,  -14.102, -13.268, -12.436, -11.608, -10.783, -9.96,   -9.139,  -8.32,   -7.503,  -6.688,  -5.874,
      -5.061,  -4.25,   -3.439,  -2.63,   -1.82,   -1.012,  -0.203,  0.606,   1.414,   2.223,   3.033,   3.843,
      4.654,   5.466,   6.279,   7.094,   7.91,    8.728,   9.547,   10.369,  11.194,  12.02,   12.85,   13.683,
      14.519,  15.359,  16.202,  17.05,   17.902,  18.759,  19.621,  20.488,  21.362,  22.241,  23.128,  24.022,
      24.923,  25.833,  26.751,  27.679,  28.618,  29.567,  30.528,  31.502,  32.49,   33.493,  34.512,  35.549,
      19.191,  20.056,  20.926,  21.802,  22.685,  23.575,  24.473,  25.378,  26.292,  27.216,  28.149,  29.093,
      30.048,  31.015,  31.996,  32.992,  34.002,  35.03,   36.076,  37.143,  38.231,  39.343,  40.482,  41.651,
      42.852,  44.09,   45.369,  46.695,  48.074,  49.515,  51.028,  52.627};
  constexpr Degrees kAzimuthDeg{
      10.108, 9.72,   9.384,  9.091,  8.833,  8.603,  8.396,  8.209,  8.04,   7.885,  7.743,  7.612,  7.492,
      7.38,   7.277,  7.18,   7.09,   7.006,  6.928,  6.854,  6.785,  6.721,  6.66,   6.602,  6.549,  6.498,
      6.45,   6.405,  6.363,  6.323,  6.285,  6.25,   -6.217, -6.186, -6.157, -6.129, -6.104, -6.08,  -6.057,
      -6.037, -6.018, -6.0,   -5.984, -5.969, -5.955, -5.943, -5.927, -5.923, -5.915, -5.908, -5.902, -5.897,
      -5.894, -5.892, -5.891, -5.891, -5.893, -5.896, -5.899, -5.905, -5.911, -5.919, -5.927, -5.938, 5.949,
      5.962,  5.976,  5.992,  6.008,  6.027,  6.047,  6.068,  6.091,  6.116,  6.143,  6.171,  6.201,  6.233,
      6.267,  6.304,  6.343,  6.384,  6.427,  6.474,  6.523,  6.575,  6.631,  6.69,   6.752,  6.819,  6.89,
      6.966,  7.047,  7.134,  7.227,  7.327,  -6.25,  -6.285, -6.323, -6.363, -6.405, -6.45,  -6.498, -6.549,
      -6.602, -6.66,  -6.721, -6.785, -6.854, -6.928, -7.006, -7.09,  -7.18,  -7.277, -7.38,  -7.492, -7.612,
      -7.743, -7.885, -8.04,  -8.209, -8.396, -8.603, -8.833, -9.091, -9.384, -9.72,  -10.108};
  const auto first = [&](std::size_t i) { return kQt128FirstNs[(i < 32 ? i + 32 : i) - 32]; };
  const auto second = [&](std::size_t i) { return first(i ^ 34U); }; // halves and pairs are swapped
  constexpr nanoseconds kColumn{111'110};
  return {{3, 2},
          {12, 2, 4, 128, 2, true, kLongTail},
          {1095, 1127},
          false,
          nanoseconds{9'000},
          0.05F,
          SequenceFrom::mode_flag,
          {sequence(kColumn, first, 0b0011), sequence(kColumn, second, 0b1100)},
          calibration(128, kElevationDeg, kAzimuthDeg)};
}

/// OT128: firing times from nebula, which quotes an early manual. The table in the maker's newer SDK differs by up to
/// 24 us, and no recording is available to decide which is correct.
ModelSpec ot128() {
  constexpr std::array kFiringNs{
      49'758, 43'224, 36'690, 30'156, 21'980, 15'446, 8'912,  2'378,  49'758, 43'224, 36'690, 30'156, 2'378,
      15'446, 8'912,  21'980, 43'224, 30'156, 49'758, 15'446, 36'690, 2'378,  21'980, 8'912,  34'312, 45'002,
      38'468, 40'846, 40'846, 34'312, 51'536, 47'380, 31'934, 47'380, 31'934, 51'536, 38'468, 27'778, 27'778,
      45'002, 38'468, 40'846, 51'536, 45'002, 31'934, 47'380, 34'312, 27'778, 38'468, 40'846, 51'536, 45'002,
      31'934, 34'312, 27'778, 38'468, 40'846, 51'536, 45'002, 31'934, 47'380, 34'312, 27'778, 45'002, 45'002,
      51'536, 38'468, 40'846, 47'380, 40'846, 31'934, 45'002, 27'778, 38'468, 40'846, 31'934, 27'778, 38'468,
      34'312, 34'312, 34'312, 47'380, 51'536, 31'934, 51'536, 47'380, 27'778, 49'758, 21'980, 43'224, 15'446,
      43'224, 36'690, 8'912,  30'156, 2'378,  49'758, 21'980, 36'690, 15'446, 8'912,  30'156, 2'378,  49'758,
      43'224, 36'690, 30'156, 21'980, 15'446, 8'912,  2'378,  43'224, 49'758, 30'156, 36'690, 21'980, 15'446,
      2'378,  8'912,  49'758, 43'224, 36'690, 30'156, 21'980, 15'446, 8'912,  2'378,  30'156};
  constexpr Degrees kElevationDeg{
      15.139,  13.432,  11.919,  10.634,  9.967,   9.3,     8.621,   7.945,   7.595,   7.244,   6.905,   6.55,
      6.193,   5.843,   5.482,   5.116,   4.768,   4.402,   4.04,    3.68,    3.314,   2.94,    2.58,    2.203,
      2.081,   1.967,   1.844,   1.71,    1.596,   1.474,   1.333,   1.23,    1.109,   0.97,    0.856,   0.734,
      0.597,   0.477,   0.361,   0.217,   0.102,   -0.012,  -0.146,  -0.272,  -0.387,  -0.522,  -0.649,  -0.757,
      -0.899,  -1.018,  -1.135,  -1.272,  -1.397,  -1.512,  -1.648,  -1.777,  -1.884,  -2.028,  -2.146,  -2.261,
      -2.397,  -2.526,  -2.639,  -2.775,  -2.894,  -3.016,  -3.154,  -3.271,  -3.394,  -3.534,  -3.644,  -3.768,
      -3.913,  -4.022,  -4.149,  -4.285,  -4.405,  -4.52,   -4.662,  -4.777,  -4.896,  -5.043,  -5.155,  -5.272,
      -5.419,  -5.539,  -5.654,  -5.806,  -5.907,  -6.288,  -6.669,  -7.039,  -7.416,  -7.794,  -8.173,  -8.546,
      -8.915,  -9.295,  -9.666,  -10.041, -10.414, -10.785, -11.15,  -11.521, -11.895, -12.26,  -12.638, -12.992,
      -13.368, -13.727, -14.096, -14.451, -14.806, -15.167, -15.517, -15.881, -16.233, -16.585, -16.934, -17.288,
      -17.642, -18.332, -19.005, -19.665, -20.318, -21.598, -22.989, -24.71};
  constexpr Degrees kAzimuthDeg{
      0.157,  0.129, 1.258, 1.247,  0.145, 0.123, 0.1,    0.078, 1.338, 1.316,  1.298, 1.28,  1.282,  1.334, 1.314,
      1.363,  0.141, 0.099, 0.171,  0.15,  0.115, 0.097,  0.166, 0.123, -3.092, 1.374, 4.55,  -3.071, 1.362, 4.542,
      -3.033, 1.385, 4.535, -3.053, 1.33,  4.609, -3.085, 1.314, 4.528, -3.064, 0.15,  2.981, -1.431, 0.173, 2.954,
      -1.445, 0.139, 2.941, -1.478, 0.161, 3.027, -1.455, 0.131, 3.015, -1.495, 0.115, 2.985, -1.47,  0.202, 3.012,
      -1.505, 0.188, 2.975, -1.521, 1.399, 4.636, -3.055, 1.374, 4.623, -3.068, 1.382, 4.595, -3.078, 1.336, 4.621,
      -3.093, 1.351, 4.587, -3.104, 1.358, 4.613, -3.119, 1.407, 4.677, -3.126, 1.421, 4.665, -3.147, 0.198, 0.194,
      0.171,  0.178, 0.148, 0.149,  0.123, 0.126, 1.427,  1.408, 1.433, 1.386,  1.411, 1.385, 1.363,  1.362, 0.2,
      0.179,  0.154, 0.133, 0.217,  0.194, 0.169, 0.147,  1.568, 1.59,  1.516,  1.536, 1.584, 1.557,  1.509, 1.533,
      0.361,  0.336, 0.313, 0.285,  1.59,  1.551, 0.312,  0.302};
  static_assert(kFiringNs.size() == kMaxChannels);
  constexpr nanoseconds kHalf{27'778};
  const auto standard = [&](std::size_t i) { return kFiringNs[i]; };
  const auto high_resolution = [&](std::size_t i) { return kFiringNs[i] % static_cast<int>(kHalf.count()); };
  return {{1, 4},
          {12, 2, 3, 128, 2, true, kLongTail},
          {861, 893, 839, 871},
          true,
          nanoseconds{43'346},
          0.1F,
          SequenceFrom::operational_state,
          {sequence(2 * kHalf, standard), sequence(kHalf, high_resolution)},
          calibration(128, kElevationDeg, kAzimuthDeg)};
}

const std::array<ModelSpec, kModels>& all_specs() {
  static const std::array<ModelSpec, kModels> specs{pandar40p(),
                                                    pandar64(),
                                                    qt64(),
                                                    xt(16, 8, 568, 0.05F, 16, 3'024, fan(16, 15.0, 2.0)),
                                                    xt(32, 8, 1080, 0.05F, 32, 1'512, fan(32, 15.0, 1.0)),
                                                    xt(32, 6, 820, 0.5F, 16, 2'888, fan(32, 19.5, 1.3)),
                                                    qt128(),
                                                    ot128()};
  return specs;
}

} // namespace

void Calibration::assign_rings() { number_rings(std::span{storage}.first(laser_count)); }

const ModelSpec& spec(Model model) { return all_specs()[static_cast<std::size_t>(model)]; }

std::optional<ReturnMode> return_mode_from_byte(std::uint8_t byte) {
  switch (byte) {
  case 0x33:
    return ReturnMode::first;
  case 0x34:
    return ReturnMode::second;
  case 0x37:
    return ReturnMode::strongest;
  case 0x38:
    return ReturnMode::last;
  case 0x39:
  case 0x3A:
  case 0x3B:
  case 0x3C:
  case 0x3E:
    return ReturnMode::dual;
  case 0x3D:
    return ReturnMode::triple;
  default:
    return std::nullopt;
  }
}

Duration packet_duration(Model model, ReturnMode mode, std::size_t sequence) {
  const ModelSpec& its = spec(model);
  return static_cast<Duration::rep>(its.layout.blocks / returns_of(mode)) * its.sequences[sequence].column_duration;
}

} // namespace locus::hesai
