// SPDX-License-Identifier: Apache-2.0
#include "locus_sim/furnishing.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "locus_sim/figures.hpp"

namespace locus::sim {
namespace {

constexpr double kSlab_m = 5, kSeam_m = 0.02; // slabs overlap by a seam, without gaps
constexpr double kDoorway_m = 3;
constexpr double kFree_m = 0.9; // between the middle of a road and objects beside it

} // namespace

void Furnishing::slabs(const Area& area, double z_m, std::uint8_t bright) {
  const auto uneven = [&] { return dice_.between(-0.002, 0.002); };
  for (double x = area.min_m.x(); x < area.max_m.x(); x += kSlab_m) {
    for (double y = area.min_m.y(); y < area.max_m.y(); y += kSlab_m) {
      const double length = std::min(kSlab_m, area.max_m.x() - x), width = std::min(kSlab_m, area.max_m.y() - y);
      const double height = z_m + uneven(), along = uneven(), across = uneven();
      build_.rectangle({x - kSeam_m / 2, y - kSeam_m / 2, height}, {length + kSeam_m, 0, along},
                       {0, width + kSeam_m, across}, bright);
    }
  }
}

void Furnishing::wall_panel(const Area& area, double from_z, double to_z, std::uint8_t bright) {
  const Eigen::Vector2d size = area.max_m - area.min_m;
  const bool along_x = size.x() > size.y();
  const double shift = dice_.between(-0.01, 0.01), lean_rad = dice_.between(-0.002, 0.002);
  const Eigen::Vector2d center =
      (area.min_m + area.max_m) / 2 + (along_x ? Eigen::Vector2d{0, shift} : Eigen::Vector2d{shift, 0});
  build_.turned_box({center.x(), center.y(), from_z}, {size.x() + kSeam_m, size.y() + kSeam_m, to_z - from_z}, lean_rad,
                    bright);
}

void Furnishing::wall(const Area& area, double height_m, std::uint8_t bright) {
  const Eigen::Vector2d size = area.max_m - area.min_m;
  const Eigen::Index axis = size.x() > size.y() ? 0 : 1;
  const auto part = [&](double from, double to) {
    Area panel = area;
    panel.min_m[axis] = from;
    panel.max_m[axis] = to;
    return panel;
  };
  std::vector<double> doors; // positions of roads through the middle of the wall
  const Eigen::Vector2d middle = (area.min_m + area.max_m) / 2;
  for (const Roads::Lane& lane : roads_.lanes()) {
    const Eigen::Vector2d a = roads_.places_m()[lane.from], b = roads_.places_m()[lane.to];
    const double before = a[1 - axis] - middle[1 - axis], behind = b[1 - axis] - middle[1 - axis];
    const double at = a[axis] + (b - a)[axis] * before / (before - behind);
    if (before * behind < 0 && at > area.min_m[axis] && at < area.max_m[axis])
      doors.push_back(at);
  }
  doors.push_back(area.max_m[axis] + kDoorway_m);
  std::sort(doors.begin(), doors.end());
  double from = area.min_m[axis];
  for (const double door : doors) {
    const double end = std::min(door - kDoorway_m / 2, area.max_m[axis]);
    while (from < end) {
      const double to = end - from < 1.5 * kSlab_m ? end : from + kSlab_m;
      wall_panel(part(from, to), 0, height_m, bright);
      from = to;
    }
    from = door + kDoorway_m / 2;
    if (height_m > kDoorway_m && end < area.max_m[axis])
      wall_panel(part(end, from), kDoorway_m, height_m, bright); // lintel
  }
}

void Furnishing::clutter(const Area& area, int count, double max_size_m) {
  for (int i = 0; i < count; ++i) {
    const double size = std::min(max_size_m, 0.3 + std::pow(dice_.between(0, 1), 2) * max_size_m);
    const Eigen::Vector2d at{dice_.between(area.min_m.x(), area.max_m.x()),
                             dice_.between(area.min_m.y(), area.max_m.y())};
    if (roads_.distance_m(at) > kFree_m + 0.75 * size)
      item(at, size);
  }
}

void Furnishing::item(const Eigen::Vector2d& at, double size_m) {
  const Eigen::Vector3d floor{at.x(), at.y(), 0};
  const double yaw_rad = dice_.between(-0.1, 0.1) + (dice_.chance(0.2) ? dice_.between(0, 1.5) : 0);
  const std::uint8_t bright = dice_.brightness(15, 110);
  const double kind = dice_.between(0, 1);
  if (kind < 0.35) { // crate
    build_.turned_box(floor, {size_m, size_m * dice_.between(0.6, 1), size_m * dice_.between(0.5, 1)}, yaw_rad, bright);
  } else if (kind < 0.55) { // cabinet
    build_.turned_box(floor, {std::min(size_m, 1.2), 0.6, dice_.between(1.6, 2.3)}, yaw_rad, bright);
  } else if (kind < 0.75) { // drums
    for (const double aside : {-0.32, 0.32})
      build_.cylinder(floor + Eigen::Vector3d{aside, dice_.between(-0.1, 0.1), 0}, 0.29, 0.88, bright);
  } else if (kind < 0.9) { // tank on a plinth, with a pipe upwards
    const double radius = std::max(0.3, size_m / 2), height = radius * dice_.between(1.5, 4);
    build_.turned_box(floor, {2.1 * radius, 2.1 * radius, 0.3}, yaw_rad, 40);
    build_.cylinder(floor, radius, height, bright);
    build_.cylinder(floor + Eigen::Vector3d{radius / 2, 0, height}, 0.08, dice_.between(1, 4), 120);
  } else { // standing pipes
    build_.cylinder(floor, dice_.between(0.04, 0.15), dice_.between(3, 8), bright);
    build_.cylinder(floor + Eigen::Vector3d{0.3, 0.1, 0}, dice_.between(0.03, 0.08), dice_.between(2, 8), bright);
  }
}

void Furnishing::pipes(const Eigen::Vector3d& from, const Eigen::Vector3d& to, int count) {
  const Eigen::Vector3d along = (to - from).normalized();
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d up{0, 0, 0.35 * i};
    build_.pipe(from + up, to + up, dice_.between(0.04, 0.12), dice_.brightness(40, 130));
  }
  for (double at = dice_.between(0.5, 3); at < (to - from).norm(); at += dice_.between(3, 7)) {
    const Eigen::Vector3d bracket = from + at * along;
    build_.turned_box(bracket - Eigen::Vector3d{0, 0, 0.15}, {0.1, 0.1, 0.35 * count + 0.1}, 0, 60);
  }
}

void Furnishing::railing(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d up{0, 0, 1};
  const double length = (to - from).norm();
  for (double at = 0.1; at < length; at += dice_.between(1.7, 2.2))
    build_.cylinder(from + at / length * (to - from), 0.02, 1.05, 90);
  for (const double height : {0.55, 1.05})
    build_.pipe(from + height * up, to + height * up, 0.022, 90);
}

void Furnishing::person(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const double period_s = std::numbers::pi * (to - from).norm() / dice_.between(0.8, 1.3);
  build_.mover({standing_person(), {from.x(), from.y(), 0}, {to.x(), to.y(), 0}, period_s, dice_.between(0, 1)});
}

void Furnishing::forklift(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d along = to - from;
  const double period_s = std::numbers::pi * along.norm() / dice_.between(1, 2);
  build_.mover({sim::forklift(std::atan2(along.y(), along.x())),
                {from.x(), from.y(), 0},
                {to.x(), to.y(), 0},
                period_s,
                dice_.between(0, 1)});
}

} // namespace locus::sim
