// SPDX-License-Identifier: Apache-2.0
// Effects of a lidar's imperfections on its points.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "drivers/velodyne/decoder.hpp"
#include "locus_sim/synthetic_lidar.hpp"
#include "support/returns.hpp"

namespace locus::sim {
namespace {

using std::chrono::seconds;
using velodyne::ReturnMode;

constexpr double kStep_m = 0.002; // range resolution of a VLP-16

Trajectory standing(Duration duration = seconds{2}) { return Trajectory(Course{}.stand(duration)); }

Surface upright(double x_m, double from_y_m, double to_y_m, std::uint8_t reflectivity = 50) {
  return {Rectangle{{x_m, from_y_m, -100}, {0, to_y_m - from_y_m, 0}, {0, 0, 200}}, reflectivity};
}

/// A panel to the left, and a wall behind and across it.
Scene panel_before_wall(double gap_m, std::uint8_t panel = 50, std::uint8_t wall = 50) {
  return Scene({upright(10, 0, 8, panel), upright(10 + gap_m, -8, 8, wall)});
}

/// Returns the points that a lidar at the origin measures in 15 turns.
std::vector<Eigen::Vector3d> points_m(const Scene& scene, const SyntheticLidarOptions& options) {
  const Trajectory trajectory = standing();
  SyntheticLidar lidar(scene, trajectory, options);
  velodyne::Decoder decoder({.model = std::get<velodyne::Model>(options.model)});
  const auto packet = std::make_unique<LidarPacket>();
  std::vector<Eigen::Vector3d> all;
  for (int i = 0; i < 1130; ++i) {
    if (decoder.decode(lidar.next().payload, *packet))
      continue;
    for (const LidarReturn& echo : test::returns_of(*packet))
      all.emplace_back(Eigen::Vector3f{echo.x_m, echo.y_m, echo.z_m}.cast<double>());
  }
  return all;
}

std::vector<double> depths_m(const Scene& scene, const SyntheticLidarOptions& options) {
  std::vector<double> all;
  for (const Eigen::Vector3d& point : points_m(scene, options))
    all.push_back(point.x());
  return all;
}

std::ptrdiff_t count_between(const std::vector<double>& all, double from, double to) {
  return std::count_if(all.begin(), all.end(), [&](double x) { return from < x && x < to; });
}

double mean_between(const std::vector<double>& all, double from, double to) {
  double sum = 0;
  for (const double x : all)
    sum += from < x && x < to ? x : 0;
  return sum / static_cast<double>(count_between(all, from, to));
}

/// The edge is crossed 16 times per turn, each time between two columns that are 35 mm apart there; the beam is 26 mm
/// wide. No point lies anywhere but on or between both surfaces.
TEST(LidarBeam, MixedPixelsLieBetweenBothSurfaces) {
  const Scene scene = panel_before_wall(0.6);
  const SyntheticLidarOptions line{.rpm = 597}, beam{.rpm = 597, .beam_rad = 0.003};
  EXPECT_EQ(count_between(depths_m(scene, line), 10.03, 10.57), 0);
  const std::vector<double> depths = depths_m(scene, beam);
  const std::ptrdiff_t mixed = count_between(depths, 10.03, 10.57);
  EXPECT_GT(mixed, 15 * 16 / 2);
  EXPECT_LT(mixed, 15 * 16);
  EXPECT_EQ(count_between(depths, 9.98, 10.62), std::ssize(depths));
}

TEST(LidarBeam, MixedPixelsLieNearerToTheBrighterSurface) {
  const SyntheticLidarOptions beam{.rpm = 597, .beam_rad = 0.003};
  const double near_m = mean_between(depths_m(panel_before_wall(0.6, 90, 10), beam), 10.03, 10.57);
  const double far_m = mean_between(depths_m(panel_before_wall(0.6, 10, 90), beam), 10.03, 10.57);
  EXPECT_LT(near_m, 10.25);
  EXPECT_GT(far_m, 10.35);
}

TEST(LidarBeam, SurfacesFartherApartThanThePulseIsLongAreNotMixed) {
  const std::vector<double> depths = depths_m(panel_before_wall(3), {.rpm = 597, .beam_rad = 0.003});
  EXPECT_EQ(count_between(depths, 10.02, 12.98), 0);
  EXPECT_GT(count_between(depths, 9.98, 10.02), 1000);
  EXPECT_GT(count_between(depths, 12.98, 13.02), 1000);
}

/// The scan line follows the upper edge of a panel, 1.5 mm above the middle of a beam that is 6.5 mm high there.
TEST(LidarBeam, HasAVerticalDivergence) {
  const double top_m = velodyne::spec(velodyne::Model::vlp16).calibration.lasers()[1].vertical_offset_m +
                       5 * std::tan(kRadPerDeg) + 0.0015;
  const Scene scene({{Rectangle{{5, -0.4, top_m - 1}, {0, 0.8, 0}, {0, 0, 1}}}, upright(5.5, -8, 8)});
  const auto mixed = [&](double beam_rad) { // away from the panel's sides
    const auto points = points_m(scene, {.rpm = 597, .beam_rad = beam_rad});
    return std::count_if(points.begin(), points.end(), [](const Eigen::Vector3d& point) {
      return std::abs(point.y()) < 0.3 && 5.01 < point.x() && point.x() < 5.49;
    });
  };
  EXPECT_EQ(mixed(0), 0);
  EXPECT_GT(mixed(0.003), 15 * 34 / 2); // 34 columns per turn
}

TEST(LidarBeam, DualReturnsMeasureBothSurfacesOfAnEdge) {
  const Scene scene = panel_before_wall(3);
  const Trajectory trajectory = standing();
  SyntheticLidar lidar(scene, trajectory, {.return_mode = ReturnMode::dual, .rpm = 597, .beam_rad = 0.003});
  int pairs = 0;
  for (int i = 0; i < 1500; ++i) {
    const Datagram datagram = lidar.next();
    const auto ticks = [&](std::size_t block, std::size_t channel) {
      const std::size_t at = block * velodyne::kBlockBytes + 4 + 3 * channel;
      return std::to_integer<unsigned>(datagram.payload[at]) | std::to_integer<unsigned>(datagram.payload[at + 1])
                                                                   << 8U;
    };
    for (std::size_t block = 0; block < velodyne::kBlocks; block += 2)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
        const unsigned last = ticks(block, channel), strongest = ticks(block + 1, channel);
        ASSERT_GE(last, strongest); // equal reflectivity: the nearer is stronger, or the last is alone
        if (last != strongest) {
          EXPECT_NEAR(kStep_m * (last - strongest), 3, 0.2); // along the ray, up to 15 degrees upwards
          ++pairs;
        }
      }
  }
  EXPECT_GT(pairs, 10 * 16 / 2);
}

/// Returns the ranges by laser of one packet in an empty room.
std::vector<std::vector<double>> ranges_by_laser(const Scene& scene, const SyntheticLidarOptions& options) {
  const Trajectory trajectory = standing();
  SyntheticLidar lidar(scene, trajectory, options);
  const velodyne::ModelSpec& spec = velodyne::spec(std::get<velodyne::Model>(options.model));
  std::vector<std::vector<double>> all(spec.calibration.laser_count);
  for (int i = 0; i < 75; ++i) {
    const Datagram datagram = lidar.next();
    for (std::size_t block = 0; block < velodyne::kBlocks; ++block)
      for (std::size_t channel = 0; channel < velodyne::kChannels; ++channel) {
        const std::size_t at = block * velodyne::kBlockBytes + 4 + 3 * channel;
        const unsigned ticks =
            std::to_integer<unsigned>(datagram.payload[at]) | std::to_integer<unsigned>(datagram.payload[at + 1]) << 8U;
        all[spec.firings()[channel].laser].push_back(spec.calibration.distance_resolution_m * ticks);
      }
  }
  return all;
}

double rms(const std::vector<double>& all) {
  return std::sqrt(std::inner_product(all.begin(), all.end(), all.begin(), 0.0) / static_cast<double>(all.size()));
}

// RMS bounds of 32 draws with standard deviation 1, exceeded once in ten thousand.
constexpr double kLeastOf32 = 0.57, kMostOf32 = 1.5;

TEST(LidarErrors, EachLaserHasItsOwnConstantRangeError) {
  const Scene scene({{Box{{0, 0, 0}, {7, 6, 5}}}});
  const auto right = ranges_by_laser(scene, {.model = velodyne::Model::hdl32e});
  const auto wrong = ranges_by_laser(scene, {.model = velodyne::Model::hdl32e, .laser_bias_m = 0.05});
  std::vector<double> errors;
  for (std::size_t laser = 0; laser < right.size(); ++laser) {
    errors.push_back(wrong[laser].front() - right[laser].front());
    for (std::size_t i = 0; i < right[laser].size(); ++i)
      ASSERT_NEAR(wrong[laser][i] - right[laser][i], errors.back(), 1.01 * kStep_m) << "laser " << laser;
  }
  ASSERT_EQ(errors.size(), 32U);
  EXPECT_GT(rms(errors), kLeastOf32 * 0.05);
  EXPECT_LT(rms(errors), kMostOf32 * 0.05);
}

/// The floor reveals the elevation of each beam below the horizon.
TEST(LidarErrors, EachLaserHasItsOwnElevationError) {
  constexpr double kHeight_m = 2, kSize_rad = 0.3 * kRadPerDeg;
  const Scene floor({{Rectangle{{-200, -200, -kHeight_m}, {400, 0, 0}, {0, 400, 0}}}});
  const auto model = velodyne::Model::hdl32e;
  const auto ranges = ranges_by_laser(floor, {.model = model, .laser_elevation_rad = kSize_rad});
  std::vector<double> errors;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const velodyne::Laser& laser = velodyne::spec(model).calibration.lasers()[i];
    if (laser.elevation_rad > -5 * kRadPerDeg)
      continue;
    const double elevation_rad = -std::asin((kHeight_m + laser.vertical_offset_m) / ranges[i].front());
    errors.push_back(elevation_rad - laser.elevation_rad);
  }
  ASSERT_GE(errors.size(), 16U);
  EXPECT_GT(rms(errors), 0.45 * kSize_rad); // of 16 and more
  EXPECT_LT(rms(errors), 1.7 * kSize_rad);
}

/// Returns the range error along x of the laser one degree above the horizon, relative to a perfect lidar.
double farther_m(const Scene& scene, const SyntheticLidarOptions& options) {
  const auto first_m = [&](const SyntheticLidarOptions& asked) {
    const auto lasers = velodyne::spec(std::get<velodyne::Model>(asked.model)).calibration.lasers();
    const auto level = std::find_if(lasers.begin(), lasers.end(), [](const velodyne::Laser& laser) {
      return std::abs(laser.elevation_rad - kRadPerDeg) < 1e-6;
    });
    return ranges_by_laser(scene, asked)[static_cast<std::size_t>(level - lasers.begin())].front();
  };
  return first_m(options) - first_m({});
}

/// A plane through (x, 0, 0) that a ray along x meets at this angle of incidence.
Scene slanting(double x_m, double incidence_deg) {
  const double along_rad = (90 - incidence_deg) * kRadPerDeg;
  const Eigen::Vector3d along{std::cos(along_rad), std::sin(along_rad), 0};
  return Scene({{Rectangle{Eigen::Vector3d{x_m, 0, -50} - 90 * along, 180 * along, {0, 0, 100}}}});
}

TEST(LidarErrors, RangeErrorGrowsWithIncidenceAndIsBounded) {
  constexpr double kSize_m = 0.1;
  const SyntheticLidarOptions options{.incidence_bias_m = kSize_m};
  EXPECT_NEAR(farther_m(slanting(10, 75), options), kSize_m, 0.05 * kSize_m);
  EXPECT_NEAR(farther_m(slanting(5, 75), options), kSize_m / 4, 2 * kStep_m); // half the footprint
  EXPECT_EQ(farther_m(slanting(10, 0), options), 0);
  EXPECT_LT(farther_m(slanting(10, 45), options), 0.1 * kSize_m);
  EXPECT_NEAR(farther_m(slanting(30, 86), options), 9 * kSize_m, 2 * kStep_m);
}

TEST(LidarErrors, DarkSurfacesMeasureFartherAndRetroreflectorsDoNot) {
  constexpr double kSize_m = 0.2;
  const auto farther = [&](std::uint8_t reflectivity) {
    return farther_m(Scene({upright(10, -20, 20, reflectivity)}), {.intensity_bias_m = kSize_m});
  };
  EXPECT_NEAR(farther(1), 0.99 * kSize_m, kStep_m);
  EXPECT_NEAR(farther(50), 0.5 * kSize_m, kStep_m);
  EXPECT_EQ(farther(100), 0);
  EXPECT_EQ(farther(255), 0);
}

/// An oscillator that is 1 % fast: all firings are early by that, while the packets' stamps are nominal.
TEST(LidarClock, DriftScalesTheFiringsButNotTheRotor) {
  constexpr double kDrift = 0.01, kRpm = 600;
  constexpr int kPackets = 300;
  const Scene nothing({});
  const Trajectory trajectory = standing();
  SyntheticLidar lidar(nothing, trajectory, {.rpm = kRpm, .drift = kDrift});
  const auto stamp_us = [](const Datagram& datagram) {
    unsigned value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value |= std::to_integer<unsigned>(datagram.payload[velodyne::kTimeOffset + i]) << (8 * i);
    return value;
  };
  const auto azimuth_cdeg = [](const Datagram& datagram) {
    return std::to_integer<unsigned>(datagram.payload[2]) | std::to_integer<unsigned>(datagram.payload[3]) << 8U;
  };
  Datagram datagram = lidar.next();
  const Stamp first = datagram.receive_stamp;
  const unsigned first_us = stamp_us(datagram), first_cdeg = azimuth_cdeg(datagram);
  for (int i = 0; i < kPackets; ++i)
    datagram = lidar.next();
  const double said_s = 1e-6 * (stamp_us(datagram) - first_us), took_s = to_seconds(datagram.receive_stamp - first);
  EXPECT_NEAR(said_s, kPackets * 1327.104e-6, 1.1e-6);
  EXPECT_NEAR(took_s, said_s / (1 + kDrift), 2e-6);
  const double turned_cdeg = std::fmod(took_s * kRpm / 60 * 36'000 + first_cdeg, 36'000);
  EXPECT_NEAR(azimuth_cdeg(datagram), turned_cdeg, 2);
}

/// The robot turns and drives; its own parts stay fixed in the lidar's view and are not in the map.
TEST(LidarView, PartsOfTheRobotAreStaticInTheViewAndAbsentFromTheMap) {
  const Scene scene({{Rectangle{{-30, -30, -30}, {60, 0, 0}, {0, 60, 0}}}}); // below, out of view
  const Trajectory trajectory(Course{}.change_speed(1, seconds{1}).turn(3, 3.0), {},
                              {.height_m = 0.03, .tilt_rad = 0.03, .wavelength_m = 1});
  const Pose T_base_lidar{from_rpy_rad({0, 0.1, 0.4}), {0.1, 0, 0.5}};
  const Sphere knob{{0.8, 0.3, 0.5}, 0.1};
  ObservedSpace seen(scene.bounds());
  SyntheticLidar lidar(scene, trajectory, {.T_base_lidar = T_base_lidar, .max_range_m = 5, .own_parts = {{knob, 40}}},
                       &seen);
  velodyne::Decoder decoder({.model = velodyne::Model::vlp16});
  const auto packet = std::make_unique<LidarPacket>();
  std::size_t returns = 0;
  for (int i = 0; i < 1500; ++i) {
    if (decoder.decode(lidar.next().payload, *packet))
      continue;
    for (const LidarReturn& echo : test::returns_of(*packet)) {
      const Eigen::Vector3d point = T_base_lidar * Eigen::Vector3f{echo.x_m, echo.y_m, echo.z_m}.cast<double>();
      ASSERT_LT(knob.distance_m(point), kStep_m);
      ++returns;
    }
  }
  EXPECT_GT(returns, 1000U);
  EXPECT_FALSE(seen.reaches_into(scene.bounds()));
}

TEST(LidarView, PartsOfTheRobotOccludeWhatIsBehindThem) {
  const Scene room({{Box{{0, 0, 0}, {7, 6, 5}}}});
  const SyntheticLidarOptions bare{}, hooded{.own_parts = {{Sphere{{0, 0, 0}, 1}, 40}}};
  for (const auto& laser : ranges_by_laser(room, hooded))
    EXPECT_NEAR(*std::max_element(laser.begin(), laser.end()), 1, 0.02);
  EXPECT_GT(ranges_by_laser(room, bare).front().front(), 5);
}

} // namespace
} // namespace locus::sim
