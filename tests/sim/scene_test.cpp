// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support/scenes.hpp"

namespace locus::sim {
namespace {

Eigen::Vector3d random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Eigen::Vector3d{x, y, z}.normalized();
}

/// Marches along the ray by the distance to the nearest surface, which cannot step over one.
double marched_range_m(const Scene& scene, const Ray& ray, double max_range_m) {
  double range_m = 0;
  for (int step = 0; step < 100'000 && range_m < max_range_m; ++step) {
    const double free_m = scene.distance_to_surface(ray.origin_m + range_m * ray.direction);
    if (free_m < 1e-7)
      return range_m;
    range_m += free_m;
  }
  return range_m;
}

TEST(Scene, RayHitsARectangleAtItsRange) {
  const Scene scene({{Rectangle{{2, -1, -1}, {0, 2, 0}, {0, 0, 2}}, 7}});
  const auto hit = scene.cast({{0, 0, 0}, {1, 0, 0}}, 10);
  ASSERT_TRUE(hit);
  EXPECT_DOUBLE_EQ(hit->range_m, 2);
  EXPECT_EQ(hit->reflectivity, 7);
  EXPECT_FALSE(scene.cast({{0, 0, 0}, {-1, 0, 0}}, 10));
  EXPECT_FALSE(scene.cast({{0, 0, 0}, {1, 0, 0}}, 1.9));
  EXPECT_FALSE(scene.cast({{0, 1.1, 0}, {1, 0, 0}}, 10));
}

TEST(Scene, BoxIsHitFromOutsideAndFromInside) {
  const Scene scene({{Box{{0, 0, 0}, {1, 2, 3}}, 0}});
  EXPECT_DOUBLE_EQ(scene.cast({{-5, 0, 0}, {1, 0, 0}}, 10)->range_m, 4);
  EXPECT_DOUBLE_EQ(scene.cast({{0, 0, 0}, {0, 1, 0}}, 10)->range_m, 2);
  EXPECT_DOUBLE_EQ(scene.distance_to_surface({0, 0, 0}), 1);
  EXPECT_DOUBLE_EQ(scene.distance_to_surface({4, 6, 0}), 5);
}

TEST(Scene, RotatedBoxIsHitAtItsCorner) {
  const double half = std::sqrt(0.5);
  const Scene scene({{Box{{0, 0, 0}, {1, 1, 1}, half, half}, 0}});
  EXPECT_NEAR(scene.cast({{-5, 0, 0}, {1, 0, 0}}, 10)->range_m, 5 - std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(scene.distance_to_surface({3, 0, 0}), 3 - std::sqrt(2.0), 1e-9);
}

TEST(Scene, CylinderEndsAtItsHeight) {
  const Scene scene({{Cylinder{{5, 0, 0}, 1, 2}, 0}});
  EXPECT_DOUBLE_EQ(scene.cast({{0, 0, 1}, {1, 0, 0}}, 10)->range_m, 4);
  EXPECT_FALSE(scene.cast({{0, 0, 2.1}, {1, 0, 0}}, 10));
  EXPECT_DOUBLE_EQ(scene.distance_to_surface({5, 0, 1}), 1);
}

TEST(Scene, ConcentricSurfacesAreAllRetained) {
  std::vector<Surface> shells;
  for (int i = 1; i <= 40; ++i)
    shells.push_back({Sphere{{0, 0, 0}, 1.0 * i}, static_cast<std::uint8_t>(i)});
  const Scene scene(shells);
  for (int i = 1; i <= 40; ++i) {
    const auto hit = scene.cast({{0, 0, i - 0.5}, {0, 0, 1}}, 100);
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->reflectivity, i);
  }
}

/// Two independent methods: the tree of boxes with intersection formulae, and marching by distances.
class ReadyMadeScene : public testing::TestWithParam<std::pair<const char*, Scene>> {};

TEST_P(ReadyMadeScene, RaysAgreeWithRayMarching) {
  const Scene& scene = GetParam().second;
  std::mt19937_64 random(3);
  for (int i = 0; i < 300; ++i) {
    const Ray ray{{2.0 + 0.009 * i, 0.1, 1.0}, random_direction(random)};
    const auto hit = scene.cast(ray, 30);
    const double marched_m = marched_range_m(scene, ray, 30);
    if (!hit)
      EXPECT_GE(marched_m, 30 - 1e-6);
    else // marching stops slightly early if a ray grazes a surface
      EXPECT_NEAR(hit->range_m, marched_m, 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(All, ReadyMadeScene,
                         testing::Values(std::pair{"room", room()}, std::pair{"corridor", corridor(40)},
                                         std::pair{"tunnel", tunnel(40)}, std::pair{"street", street(40)}),
                         [](const auto& test) { return test.param.first; });

TEST(Scene, SameSeedGivesTheSameStreet) {
  const Scene one = street(100, 5), same = street(100, 5), other = street(100, 6);
  int differences = 0;
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const Ray ray{{50, 0, 1.8}, random_direction(random)};
    const auto hit = one.cast(ray, 100), same_hit = same.cast(ray, 100), other_hit = other.cast(ray, 100);
    ASSERT_EQ(hit.has_value(), same_hit.has_value());
    if (hit) {
      EXPECT_EQ(hit->range_m, same_hit->range_m);
      differences += !other_hit || other_hit->range_m != hit->range_m;
    }
  }
  EXPECT_GT(differences, 0);
}

TEST(Scene, PlantCourseStaysAMetreFromEverything) {
  const Scene scene = plant();
  const Trajectory trajectory(plant_course(std::chrono::seconds{150}, 1.0), plant_start());
  EXPECT_GT(to_seconds(trajectory.end() - trajectory.start()), 150);
  for (Stamp stamp = trajectory.start(); stamp < trajectory.end(); stamp += std::chrono::milliseconds{200}) {
    const Eigen::Vector3d sensor = trajectory.T_world_base(stamp).translation + Eigen::Vector3d{0, 0, 1.5};
    ASSERT_GT(scene.distance_to_surface(sensor), 0.9) << sensor.transpose();
  }
}

} // namespace
} // namespace locus::sim
