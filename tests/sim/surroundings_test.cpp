// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/surroundings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "locus_sim/company.hpp"
#include "locus_sim/escort.hpp"
#include "locus_sim/mirrors.hpp"
#include "locus_sim/scene_builder.hpp"
#include "support/scenes.hpp"

namespace locus::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Level ground with distant walls: 240 x 80 m.
World yard() {
  SceneBuilder build;
  build.rectangle({-20, -40, 0}, {240, 0, 0}, {0, 80, 0}, 30);
  build.rectangle({-20, -40, 0}, {240, 0, 0}, {0, 0, 6}, 60);
  build.rectangle({-20, 40, 0}, {240, 0, 0}, {0, 0, 6}, 60);
  build.rectangle({-20, -40, 0}, {0, 80, 0}, {0, 0, 6}, 60);
  build.rectangle({220, -40, 0}, {0, 80, 0}, {0, 0, 6}, 60);
  return {.scene = build.scene(), .roads = {}, .ground_m = {}, .terrain = {}, .max_speed_mps = 15};
}

/// At walking pace, with a stop, corners and a turn on the spot.
Trajectory stroll() {
  return Trajectory(Course{}
                        .stand(seconds{8})
                        .change_speed(1, seconds{2})
                        .straight(12)
                        .turn(std::numbers::pi / 2, 0.9)
                        .straight(6)
                        .turn(-2, 0.9)
                        .change_speed(0, seconds{1})
                        .turn(std::numbers::pi, 0.9)
                        .stand(seconds{6})
                        .change_speed(1.2, seconds{2})
                        .straight(15)
                        .change_speed(0, seconds{2})
                        .stand(seconds{4}));
}

Trajectory straight_on(double speed_mps, double length_m) {
  return Trajectory(Course{}.change_speed(speed_mps, seconds{5}).straight(length_m));
}

/// Fraction of moving objects in the returns of a level VLP-16 on a husky.
struct Share {
  double of_drive = 0, largest = 0; ///< maximum over single sweeps
};

Share share_of_view(const World& world, const Trajectory& trajectory) {
  std::size_t all_returns = 0, all_moving = 0;
  Share share;
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{900}) {
    std::size_t returns = 0, moving = 0;
    const Pose T_world_lidar = trajectory.T_world_base(t) * Pose{Eigen::Quaterniond::Identity(), {0, 0, 0.93}};
    for (int ring = 0; ring < 16; ++ring) {
      for (int azimuth = 0; azimuth < 360; ++azimuth) {
        const double up = kRadPerDeg * (2 * ring - 15), around = kRadPerDeg * azimuth;
        const Eigen::Vector3d aim{std::cos(up) * std::cos(around), std::cos(up) * std::sin(around), std::sin(up)};
        const auto hit = world.scene.cast({T_world_lidar.translation, T_world_lidar.rotation * aim}, 100, t);
        returns += hit.has_value();
        moving += hit && hit->surface == nullptr;
      }
    }
    share.largest = std::max(share.largest, static_cast<double>(moving) / static_cast<double>(returns));
    all_returns += returns;
    all_moving += moving;
  }
  share.of_drive = static_cast<double>(all_moving) / static_cast<double>(all_returns);
  return share;
}

World yard_with(const Imperfections& imperfections, const Trajectory& trajectory) {
  World world = yard();
  surround(world, make_husky({}, 1), trajectory, imperfections, 1);
  return world;
}

TEST(People, OccludeAModerateShareOfTheViewAndAThirdInHarshWorlds) {
  const Trajectory trajectory = stroll();
  const auto share_at = [&](Realism realism) {
    return share_of_view(yard_with({.people = imperfections_of(realism).people}, trajectory), trajectory);
  };
  const Share real = share_at(Realism::real), harsh = share_at(Realism::harsh);
  const auto record = [](const std::string& name, double share) {
    RecordProperty(name + "_permille", static_cast<int>(1e3 * share));
  };
  record("real", real.of_drive);
  record("real_largest", real.largest);
  record("harsh", harsh.of_drive);
  record("harsh_largest", harsh.largest);
  // A person at the largest distance, 3.4 m from the middle, occludes with the trunk alone a total of 6.4 degrees, on a
  // third of the rings.
  const double one = 2 * std::asin(0.19 / 3.4) / (2 * std::numbers::pi) / 3;
  EXPECT_GT(real.of_drive, 3 * one);
  EXPECT_LT(real.of_drive, 0.25);
  EXPECT_GT(harsh.of_drive, 0.25);
  EXPECT_LT(harsh.of_drive, 0.4);
  EXPECT_LT(real.largest, 0.25);
  EXPECT_GT(harsh.largest, 0.35);
  EXPECT_LT(harsh.largest, 0.45);
}

TEST(People, WalkNearTheRobotAndAvoidIt) {
  const Trajectory trajectory = stroll();
  const World world = yard_with({.people = 6}, trajectory);
  ASSERT_EQ(world.scene.passers().size(), 6U);
  const double reach_m = make_husky({}, 1).reach_m;
  std::size_t looks = 0, near = 0, walks_by_standing_robot = 0;
  for (const Passer& person : world.scene.passers()) {
    for (Stamp t = trajectory.start(); t < trajectory.end() - milliseconds{100}; t += milliseconds{50}) {
      const BaseMotion base = trajectory.at(t);
      const auto ground = [&](Stamp at) -> Eigen::Vector2d { return person.at(at).ground_m.head<2>().cast<double>(); };
      const double gap_m = (ground(t) - base.T_world_base.translation.head<2>()).norm() - reach_m;
      ASSERT_GT(gap_m, kPersonalSpace_m) << to_seconds(t - trajectory.start());
      const double speed_mps = (ground(t + milliseconds{100}) - ground(t)).norm() / 0.1;
      ASSERT_LT(speed_mps, 1.8) << to_seconds(t - trajectory.start());
      ++looks;
      near += gap_m < 3;
      walks_by_standing_robot += base.velocity_world_mps.norm() < 0.01 && speed_mps > 0.2;
    }
  }
  EXPECT_GT(near, 0.8 * static_cast<double>(looks));
  EXPECT_GT(walks_by_standing_robot, 100U); // 5 s of a minute and more, of six people
}

TEST(People, WaitBesideThePathOfAFastRobot) {
  const Trajectory trajectory = straight_on(12, 150);
  const World world = yard_with({.people = 6}, trajectory);
  std::vector<double> passed_at_m; // distance along the path
  for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{50}) {
    const Eigen::Vector2d base = trajectory.T_world_base(t).translation.head<2>();
    for (const Passer& person : world.scene.passers()) {
      const Eigen::Vector2d off = person.at(t).ground_m.head<2>().cast<double>() - base;
      ASSERT_GT(off.norm(), 0.85);
      if (std::abs(off.x()) < 1 && std::abs(off.y()) < 3.4)
        passed_at_m.push_back(base.x());
    }
  }
  ASSERT_FALSE(passed_at_m.empty());
  EXPECT_GT(passed_at_m.back(), 100); // long after those of the start
}

TEST(Vehicle, DrivesAlongsideForTheConfiguredSecondsPerMinute) {
  for (const auto& [speed_mps, length_m] : {std::pair{1.0, 179.0}, std::pair{1.0, 119.0}}) {
    const Trajectory trajectory = straight_on(speed_mps, length_m);
    constexpr double kAsked_s = 12;
    const World world = yard_with({.vehicle_s_per_min = kAsked_s}, trajectory);
    ASSERT_EQ(world.scene.passers().size(), 1U);
    const Passer& vehicle = world.scene.passers().front();
    double alongside_s = 0;
    for (Stamp t = trajectory.start(); t < trajectory.end(); t += milliseconds{100}) {
      const Eigen::Vector2d base = trajectory.T_world_base(t).translation.head<2>();
      const Eigen::Vector2d at = vehicle.at(t).ground_m.head<2>().cast<double>();
      const Eigen::Vector2d later = vehicle.at(t + milliseconds{100}).ground_m.head<2>().cast<double>();
      const double aside_m = std::abs(at.y() - base.y());
      if ((at - base).norm() < 20) { // no vehicle appears or disappears this close
        ASSERT_LT((later - at).norm() / 0.1, 3);
        ASSERT_GT(aside_m, 1.9);
        ASSERT_LT(aside_m, 4.1);
      }
      const double faster_mps = (later - at).norm() / 0.1 - trajectory.at(t).velocity_world_mps.norm();
      alongside_s += std::abs(at.x() - base.x()) < 2 && std::abs(faster_mps) < 0.5 ? 0.1 : 0;
    }
    const double minutes = std::floor(to_seconds(trajectory.end() - trajectory.start()) / 60);
    EXPECT_GT(alongside_s, 0.8 * (minutes - 1) * kAsked_s) << "the last minute may end before it could leave";
    EXPECT_LT(alongside_s, 1.5 * (minutes + 1) * kAsked_s);
  }
}

TEST(Vehicle, NeverEntersANarrowCorridor) {
  const Trajectory trajectory(Course{}.change_speed(1, seconds{2}).straight(50), {.position_m = {5, 0}});
  const Way way(trajectory, 0.35, {});
  Dice dice(1);
  EXPECT_FALSE(escort(corridor(80), way, 20, dice));
}

/// Returns on how many of three courses of 80 s, as in the harsh table of locus-experiments, there is a vehicle.
int courses_with_vehicle(WorldMaker make_world, const NamedRobot& named) {
  int count = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    World world = make_world(seed);
    Robot robot = named.make({}, seed);
    robot.agility.halts = {.share = 0.5, .longest_s = 12};
    const Trajectory trajectory = drive_about(world, robot, seconds{80}, {}, seed);
    count += surround(world, robot, trajectory, {.vehicle_s_per_min = 20}, seed);
  }
  return count;
}

TEST(Vehicle, FitsOnSomeCoursesOfPlantFieldAndRoadButNotInTheCorridor) {
  const NamedRobot husky{"husky", make_husky}, car{"car", make_car};
  EXPECT_GE(courses_with_vehicle(make_urban, husky), 1);
  EXPECT_GE(courses_with_vehicle(make_field, husky), 1);
  EXPECT_GE(courses_with_vehicle(make_road, car), 1);
  EXPECT_EQ(courses_with_vehicle(make_corridor, husky), 0);
}

const Cloud kCloud{{5, 0, 0}, 1, 1, Start{}.stamp, Start{}.stamp + seconds{4}};

TEST(Steam, TransmissionFollowsDepthAndDensityAndTheRestIsScattered) {
  Scene scene({{Rectangle{{20, -5, -5}, {0, 10, 0}, {0, 0, 10}}, 60}});
  scene.add(Steam({kCloud}));
  for (const int after_s : {1, 2, 3}) {
    std::size_t through = 0;
    constexpr std::size_t kRays = 4000;
    for (std::size_t i = 0; i < kRays; ++i) {
      const Stamp t = kCloud.begin + seconds{after_s} + Duration{static_cast<Duration::rep>(i)};
      const auto hit = scene.cast({{0, 0, 0}, {1, 0, 0}}, 100, t);
      ASSERT_TRUE(hit);
      if (!hit->apparent) {
        EXPECT_EQ(hit->range_m, 20);
        ++through;
        continue;
      }
      ASSERT_GE(hit->range_m, 4);
      ASSERT_LE(hit->range_m, 6);
      ASSERT_LE(hit->reflectivity, 8);
    }
    const double expected = std::exp(-2 * extinction_per_m(kCloud, kCloud.begin + seconds{after_s})); // 2 m deep
    EXPECT_NEAR(static_cast<double>(through) / kRays, expected, 4 * std::sqrt(expected / kRays));
  }
  EXPECT_FALSE(scene.cast({{0, 0, 0}, {1, 0, 0}}, 100, kCloud.end)->apparent);
  EXPECT_FALSE(scene.cast({{0, 0, 0}, {1, 0, 0}}, 100, kCloud.begin - seconds{1})->apparent);
  EXPECT_FALSE(scene.cast({{0, 3, 0}, {1, 0, 0}}, 100, kCloud.begin + seconds{1})->apparent); // past the cloud
}

TEST(Steam, BurstsLastSecondsAtTheConfiguredRate) {
  const Trajectory trajectory = straight_on(1, 175); // three minutes
  const World world = yard_with({.steam_per_min = 6}, trajectory);
  const auto& clouds = world.scene.steam().clouds();
  EXPECT_NEAR(static_cast<double>(clouds.size()), 18, 1);
  for (const Cloud& cloud : clouds) {
    EXPECT_GE(to_seconds(cloud.end - cloud.begin), 2);
    EXPECT_LE(to_seconds(cloud.end - cloud.begin), 5);
    const Eigen::Vector3d base = trajectory.T_world_base(cloud.begin).translation;
    EXPECT_LT((cloud.center_m - base).head<2>().norm(), 9);
    EXPECT_GT(radius_m(cloud, cloud.end), radius_m(cloud, cloud.begin));
  }
}

/// A floor of 100 x 100 m in front of a wall at x = 10.
Scene hall(double wet, double glass) {
  Scene scene({{Rectangle{{-50, -50, 0}, {100, 0, 0}, {0, 100, 0}}, 40},
               {Rectangle{{10, -50, 0}, {0, 100, 0}, {0, 0, 8}}, 80}});
  scene.add(Mirrors(wet, glass, 7));
  return scene;
}

TEST(Mirrors, ShareOfWetFloorIsAsConfigured) {
  for (const double share : {0.03, 0.2, 0.7}) {
    const Scene scene = hall(share, 0);
    const auto is_wet = [&](double x, double y) { // looking straight down, a wet floor is darker
      return scene.cast({{x, y, 1}, {0, 0, -1}}, 5)->reflectivity < 30;
    };
    int all = 0, wet = 0, edges = 0;
    for (double x = -49; x < 9; x += 0.37) {
      for (double y = -49; y < 49; y += 0.37, ++all) {
        wet += is_wet(x, y);
        edges += is_wet(x, y) != is_wet(x + 0.05, y);
      }
    }
    EXPECT_NEAR(wet, share * all, 0.2 * share * all);
    EXPECT_LT(edges, 0.2 * wet); // steps of 5 cm rarely cross the edge of a puddle
  }
}

TEST(Mirrors, WetFloorReflectsTheWallMoreAtGrazingIncidence) {
  const Scene scene = hall(1, 0);
  const auto ghosts = [&](double down_deg) {
    int count = 0;
    for (int i = 0; i < 500; ++i) {
      const double down = kRadPerDeg * (down_deg + 1e-4 * i);
      const Ray ray{{0, 0, 0.8}, {std::cos(down), 0, -std::sin(down)}};
      const auto hit = scene.cast(ray, 100);
      if (!hit || !hit->apparent)
        continue;
      ++count;
      EXPECT_NEAR(hit->point_m.x(), 10, 1e-5); // the mirror image of the wall, below the floor
      EXPECT_LT(hit->point_m.z(), 0);
      EXPECT_NEAR(hit->range_m, 10 / std::cos(down), 1e-5);
      EXPECT_LT(hit->reflectivity, 80);
    }
    return count / 500.0;
  };
  const double steep = ghosts(30), flat = ghosts(6);
  EXPECT_LT(steep, 0.05);
  EXPECT_GT(flat, 0.8);
  EXPECT_FALSE(scene.cast({{0, 0, 0.8}, {-std::cos(0.1), 0, -std::sin(0.1)}}, 100)->apparent); // reflects the sky
}

TEST(Mirrors, ReflectanceFollowsFresnel) {
  EXPECT_NEAR(mirrored_share(1, 1.33), 0.0201, 1e-4);
  EXPECT_NEAR(mirrored_share(1, 1.52), 0.0426, 1e-4);
  EXPECT_NEAR(mirrored_share(std::cos(80 * kRadPerDeg), 1.33), 0.347, 0.005);
  EXPECT_NEAR(mirrored_share(0, 1.33), 1, 1e-9);
}

TEST(Mirrors, GlassReflectsExceptAtNormalIncidence) {
  Scene scene({{Rectangle{{10, -50, 0}, {0, 100, 0}, {0, 0, 8}}, 80},
               {Rectangle{{-10, 12, 0}, {40, 0, 0}, {0, 0, 8}}, 80}}); // a wall, and one across at y = 12
  scene.add(Mirrors(0, 1, 7));
  const auto straight_on = scene.cast({{0, 0, 1}, {1, 0, 0}}, 100);
  ASSERT_TRUE(straight_on);
  EXPECT_EQ(straight_on->range_m, 10);
  int ghosts = 0;
  for (int i = 0; i < 200; ++i) {
    const double along = kRadPerDeg * (78 + 0.01 * i); // along the pane at y = 12, to the wall and its image behind
    const Ray ray{{-8, 9, 1}, {std::sin(along), std::cos(along), 0}};
    const auto hit = scene.cast(ray, 100);
    if (!hit || !hit->apparent)
      continue;
    ++ghosts;
    EXPECT_NEAR(hit->point_m.x(), 10, 1e-5);
    EXPECT_GT(hit->point_m.y(), 12);
  }
  EXPECT_GT(ghosts, 50);
  const double slanting = kRadPerDeg * 40;
  const auto wall = scene.cast({{0, 0, 1}, {std::cos(slanting), -std::sin(slanting), 0}}, 100);
  EXPECT_TRUE(!wall || wall->reflectivity < 5) << "the wall itself is nearly dark";
}

TEST(Mirrors, ShareOfGlassPanesIsAsConfigured) {
  std::vector<Surface> walls;
  for (int i = 0; i < 200; ++i)
    walls.push_back({Rectangle{{4.0 * i, 0, 0}, {4, 0, 0}, {0, 0, 3}}, 80});
  Scene scene(walls);
  scene.add(Mirrors(0, 0.1, 3));
  int glass = 0, all = 0;
  for (double x = 0.5; x < 799; x += 1, ++all)
    glass += scene.cast({{x, -5, 1}, {0, 1, 0}}, 20)->reflectivity > 100;
  EXPECT_NEAR(glass, 0.1 * all, 4 * std::sqrt(0.1 * all * 2)); // in pairs: a pane is 2 m wide
}

TEST(Surroundings, AreEmptyInACleanWorld) {
  const Trajectory trajectory = stroll();
  const World clean = yard_with(imperfections_of(Realism::clean), trajectory);
  EXPECT_TRUE(clean.scene.passers().empty());
  EXPECT_TRUE(clean.scene.steam().clouds().empty());
  EXPECT_EQ(share_of_view(clean, trajectory).largest, 0);
}

} // namespace
} // namespace locus::sim
